"""Tones of the sonar sectors."""

import pytest

from common.messages import SONAR_NAMES, Cause, RangeStatus, Ultrasonic
from common.settings import Vehicle
from services.dashboard.sectors import Protection, Tone, sonars_named, tones
from services.safety.config import Safety
from services.safety.core.planning import zones

AS_SHIPPED = Protection()


def sonar(front: float | None, status: RangeStatus = "ok") -> Ultrasonic:
    """Return ranges of 4 m, but for the front."""
    ranges = tuple(front if name == "front" else 4.0 for name in SONAR_NAMES)
    states: list[RangeStatus] = [status if name == "front" else "ok" for name in SONAR_NAMES]
    return Ultrasonic(ranges=ranges, status=tuple(states))


def cause(name: str, text: str) -> Cause:
    return Cause(name=name, action="slow", age=1.0, text=text)


FRONT = SONAR_NAMES.index("front")


@pytest.mark.parametrize(
    ("front", "status", "tone"),
    [
        (4.0, "ok", "clear"),
        (AS_SHIPPED.full_speed_room, "ok", "clear"),
        (AS_SHIPPED.full_speed_room - 0.001, "ok", "slow"),
        (0.201, "ok", "slow"),
        (0.2, "ok", "stop"),
        (None, "no_echo", "clear"),
        (None, "too_near", "stop"),
        (None, "fault", "fault"),
        (None, "ok", "dark"),
    ],
)
def test_a_tone_for_each_reading(front: float | None, status: RangeStatus, tone: Tone) -> None:
    seen = tones(sonar(front, status), (), AS_SHIPPED)
    assert seen[FRONT] == tone
    assert {it for i, it in enumerate(seen) if i != FRONT} == {"clear"}


def test_without_data_all_sectors_are_dark() -> None:
    assert tones(None, (), AS_SHIPPED) == ("dark",) * 8


@pytest.mark.parametrize(
    ("name", "text", "tone"),
    [
        ("obstacle", "Slowed by an obstacle at 4.00 m (front).", "slow"),
        ("blocked", "No room toward the front: 4.00 m.", "stop"),
        ("sonar", "Sonar not trusted: front.", "fault"),
        ("contact", "The front was hit.", "clear"),
    ],
)
def test_the_reason_that_safety_names_sets_the_tone(name: str, text: str, tone: Tone) -> None:
    assert tones(sonar(4.0), [cause(name, text)], AS_SHIPPED)[FRONT] == tone


def test_the_worse_tone_is_kept() -> None:
    assert tones(sonar(0.1), [cause("obstacle", "(front)")], AS_SHIPPED)[FRONT] == "stop"


def test_sonars_named_in_a_text() -> None:
    assert [SONAR_NAMES[i] for i in sonars_named("Sonar not trusted: front left, rear.")] == [
        "front_left", "rear",
    ]  # fmt: skip
    assert sonars_named("All is well.") == []


def test_the_default_protection_equals_safetys_settings() -> None:
    safety = Safety()
    assert (
        Protection(
            margin=safety.margin,
            react=safety.react,
            deceleration=safety.deceleration,
            max_linear=safety.max_linear,
        )
        == Protection()
    )


def test_full_speed_needs_the_distance_of_safetys_zones() -> None:
    field = zones(Vehicle(), Safety())
    assert field.allowed(AS_SHIPPED.full_speed_room) == pytest.approx(AS_SHIPPED.max_linear)
