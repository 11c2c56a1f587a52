"""Snapshots from telemetry."""

import pytest

from common.freshness import NS_PER_S
from services.dashboard import snapshot
from services.dashboard.driver_lock import HoldState
from services.dashboard.i18n import Texts
from services.dashboard.telemetry_cache import TelemetryCache
from services.safety import report
from t2 import keys
from t2.messages import (
    SONAR_NAMES,
    Bumper,
    Cause,
    CauseName,
    Command,
    Drive,
    Driver,
    Motion,
    Phrase,
    PlaneFrame,
    RangeStatus,
    Switches,
    Ultrasonic,
    Velocity,
)
from tests import factories
from tests.safety.core.policy_fixture import PolicyFixture

AT = 100 * NS_PER_S


def full() -> TelemetryCache:
    """Return the telemetry of a robot with all messages received at ``AT``."""
    telemetry = TelemetryCache()
    for path, message in {
        "tel/bridge/velocity": Velocity(linear=0.5, angular=0.1),
        "tel/bridge/ultrasonic": Ultrasonic(ranges=(1.0,) * 8, status=("ok",) * 8),
        "tel/bridge/bumper": Bumper(pressed=True),
        "tel/bridge/link": factories.link(),
        "tel/bridge/driver/left": Driver(faults=("encoder",), bits=4),
        "tel/bridge/switches": Switches(ultrasonic_brake=True, bumper_brake=False),
        "tel/odom/odometry": factories.odometry(x=1.0, y=2.0, heading=0.3, epoch=3),
        "tel/localization/pose": factories.map_pose(),
        "tel/safety/state": factories.contact_state(source="nav"),
        "@cmd/drive/nav": Drive(linear=0.7, angular=0.2, echo=1),
        "@cmd/drive/web": Drive(linear=0.1, angular=0.0, echo=1),
        "@cmd/motion": Motion(command=Command.BRAKE),
        "tel/safety/health": factories.health("safety"),
    }.items():  # fmt: skip
        telemetry.update(path, message, AT)
    telemetry.update_liveliness("t2/v1/001/live/odom/x", True)
    return telemetry


NOBODY = snapshot.DriverState(
    None,
    "",
    HoldState.FREE,
    1,
    in_sight=False,
    other=None,
    overruled=False,
    may=True,
    may_stop=True,
)


def fast(telemetry: TelemetryCache, at: int = AT) -> snapshot.FastSnapshot:
    return snapshot.fast_snapshot(telemetry, NOBODY, at, connected=True)


def test_the_fast_snapshot() -> None:
    seen = fast(full())
    assert (seen.connected, seen.link, seen.bumper) == (True, "up", True)
    assert (seen.measured, seen.allowed) == ((0.5, 0.1), (0.0, 0.0))
    assert (seen.pose, seen.epoch) == ((1.0, 2.0, 0.3), 3)
    assert seen.requested == (0.7, 0.2)  # of the driving source
    assert seen.safety is not None
    assert (seen.safety.verdict, seen.safety.latched) == ("brake", ("contact",))
    assert seen.safety.release == factories.release()
    assert seen.driver == NOBODY


def test_without_safety_no_sector_is_clear() -> None:
    telemetry = full()
    newer = Ultrasonic(ranges=(1.0,) * 8, status=("ok",) * 8)
    telemetry.update("tel/bridge/ultrasonic", newer, AT + NS_PER_S)
    seen = fast(telemetry, at=AT + NS_PER_S)
    assert (seen.safety, seen.ranges, seen.tones) == (None, (1.0,) * 8, ("dark",) * 8)


def test_old_values_are_not_shown() -> None:
    seen = fast(full(), at=AT + 10 * NS_PER_S)
    known = (seen.measured, seen.requested, seen.allowed, seen.pose, seen.bumper, seen.link)
    assert known == (None,) * 6
    assert seen.safety is None
    assert seen.tones == ("dark",) * 8


def test_the_slow_snapshot() -> None:
    seen = snapshot.slow_snapshot(full(), {"001": True}, 1, AT)
    assert seen.instances == {"odom": 1, "safety": 0}
    assert seen.health == {"safety": full().newest(keys.HEALTH, AT, service="safety")}
    assert seen.left is not None
    assert (seen.left.bits, seen.right) == (4, None)
    assert seen.switches == Switches(ultrasonic_brake=True, bumper_brake=False)


def test_the_pose_in_the_map_has_its_ellipse_in_odom() -> None:
    view = snapshot.slow_snapshot(full(), {}, 1, AT).map
    assert view is not None
    assert (view.state, view.pose) == ("placed", (4.0, 2.0, 0.5))
    assert view.text.zh == "位置已知，标准差为 0.20 m 和 3 度。"
    assert view.ellipse == pytest.approx((0.4, 0.2, 0.0))
    turned = factories.map_pose("lost", odom=PlaneFrame(x=0.0, y=0.0, heading=0.5))
    ellipse = snapshot.map_view(turned).ellipse
    assert ellipse == pytest.approx((0.4, 0.2, -0.5))
    assert snapshot.map_view(turned).odom == (0.0, 0.0, 0.5)
    unplaced = snapshot.map_view(factories.map_pose("unplaced"))
    assert (unplaced.pose, unplaced.ellipse, unplaced.odom) == (None, None, None)
    assert "t2 call localization/place" in unplaced.text.en
    assert snapshot.slow_snapshot(full(), {}, 1, AT + NS_PER_S).map is None


@pytest.mark.parametrize(
    ("status", "cause", "sonar", "doubted", "tone"),
    [
        ("ok", "obstacle", "front", (), "slow"),
        ("ok", "blocked", "front", (), "stop"),
        ("ok", "sonar", "front", ("front_left", "front"), "fault"),
        ("ok", "blocked", "front_left", (), "clear"),
        ("ok", "contact", "front", (), "clear"),
        ("ok", "blocked", "roof", ("roof",), "clear"),  # of a foreign publisher
        ("no_echo", "contact", "front", (), "clear"),
        ("too_near", "obstacle", "front", (), "stop"),
        ("fault", "contact", "front", (), "fault"),
    ],
)
def test_the_tone_of_a_sector(
    status: RangeStatus, cause: CauseName, sonar: str, doubted: tuple[str, ...], tone: str
) -> None:
    ultrasonic = Ultrasonic(ranges=(4.0,) * 8, status=(status,) * 8)
    phrases = (Phrase("blocked.near", {"sonar": sonar, "distance": 4.0}), Phrase("next.reset"))
    causes = (Cause(name=cause, action="slow", age=1.0, text="", phrases=phrases),)
    state = factories.safety_state(causes=causes, doubted_sonars=doubted)
    assert snapshot.tones(ultrasonic, state)[SONAR_NAMES.index("front")] == tone


@pytest.mark.parametrize(("distance", "tone"), [(0.21, "stop"), (0.4, "slow"), (0.6, "clear")])
def test_a_near_wall_has_its_tone_while_the_vehicle_stands(distance: float, tone: str) -> None:
    ultrasonic = Ultrasonic(ranges=(distance,) * 8, status=("ok",) * 8)
    assert set(snapshot.tones(ultrasonic, factories.safety_state())) == {tone}


@pytest.mark.parametrize("name", SONAR_NAMES)
def test_safety_names_the_sonar_in_its_phrases(name: str) -> None:
    state, index = PolicyFixture().ready().state, SONAR_NAMES.index(name)
    for phrases in (report._blocked(state, index), report._slowed(state, index)):
        cause = Cause(name="blocked", action="stop", age=1.0, text="", phrases=phrases)
        assert snapshot.sonars_of(cause) == [name]


def test_the_texts_of_safety_in_both_languages() -> None:
    phrases = (Phrase("contact"), Phrase("control.of", {"source": "web"}))
    newer = Cause(name="contact", action="stop", age=1.0, text="a\x1b", phrases=(Phrase("newer"),))
    view = snapshot.safety_view(
        factories.safety_state(
            source="w\x1b", text="old", phrases=phrases, causes=(newer,), release_refusal="no"
        )
    )
    assert view.text == Texts(
        "The bumper was hit. web (page) is in control.", "防撞条已触发。由网页（web）控制。"
    )
    assert view.own_text == Texts(
        "The bumper was hit. You are in control.", "防撞条已触发。由您控制。"
    )
    assert view.causes[0].text == Texts("a\\u001b", "a\\u001b")  # of a newer safety
    assert view.release_refusal == Texts("no", "no")
    assert view.source == "w\\u001b"
