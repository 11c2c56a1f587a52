"""Moving off a pressed bumper, through the whole decision."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S
from services.safety.core.causes import latched
from services.safety.core.release_requests import room
from t2.catalogue import CAUSES
from t2.messages import Direction, ReleaseRequest
from t2.words import render
from tests.factories import link
from tests.safety.core.policy_fixture import (
    BUMPER_FREE,
    DIRECTIONS,
    LET_GO,
    UNKNOWN_TEXT,
    USED_UP_TEXT,
    PolicyFixture,
    hit,
)

BOTH = "The bumper was pressed in both directions. Push the vehicle off by hand, then reset."
PROGRAM = "nav may not release: only an operator who holds the controls may."
MOVES = "The vehicle still moves."
LOST = "The link to the board is lost."
Given = Callable[[PolicyFixture], object]


def forbidden(direction: str) -> str:
    return f"Release {direction} is forbidden until a reset: the bumper was pressed that way."


def with_release(**fields: object) -> Given:
    """Change what is known of the release."""

    def change(fixture: PolicyFixture) -> None:
        fixture.state = replace(fixture.state, release=replace(fixture.state.release, **fields))

    return change


def feed(**fields: object) -> Given:
    """Change what the streams report from the next tick on."""

    def change(fixture: PolicyFixture) -> None:
        for name, value in fields.items():
            setattr(fixture, name, value)
        fixture.tick()

    return change


def silent(fixture: PolicyFixture) -> None:
    fixture.muted = {"velocity"}
    fixture.tick(11)


def settled(fixture: PolicyFixture) -> None:
    """End what was wrong, and wait."""
    fixture.muted, fixture.link = set(), link()
    fixture.tick(30)


def stopped(fixture: PolicyFixture) -> None:
    fixture.estop()
    fixture.tick(3)


def two_publishers(fixture: PolicyFixture) -> None:
    fixture.driver_boot = 1
    fixture.request()
    fixture.driver_boot = 99


def press_anew(fixture: PolicyFixture, clear: int = 1) -> None:
    """Free the bumper for some ticks, then press it."""
    feed(pressed=False)(fixture)
    fixture.tick(clear - 1)
    feed(pressed=True)(fixture)


def freed(fixture: PolicyFixture) -> None:
    feed(pressed=False)(fixture)


def used(fixture: PolicyFixture) -> None:
    with_release(integrated=room(fixture.state, fixture.policy.settings))(fixture)


def nothing(_: PolicyFixture) -> None:
    """Leave it at the contact."""


# --- what is refused, and what moves -------------------------------------------------------------

CASES: dict[str, tuple[Given, Direction, str]] = {
    "backward": (nothing, "backward", ""),
    "forward": (nothing, "forward", ""),
    "an emergency stop": (lambda f: f.estop(), "backward", "Emergency stop."),
    "a stop to reset": (stopped, "backward", "Emergency stop. Reset first."),
    "no link": (feed(link=link(state="lost")), "backward", LOST),
    "motion": (feed(linear=0.3), "backward", MOVES),
    "an old velocity": (silent, "backward", "No recent data: velocity."),
    "two publishers": (two_publishers, "backward", "Two programs send as teleop."),
    "a free bumper": (freed, "backward", BUMPER_FREE),
    "a new press": (press_anew, "backward", LET_GO),
    "an earlier safety": (with_release(unknown=True), "backward", UNKNOWN_TEXT),
    "all used": (used, "backward", USED_UP_TEXT),
    "both forbidden": (with_release(forbidden=frozenset(DIRECTIONS)), "backward", BOTH),
    "forbidden": (with_release(forbidden=frozenset({"forward"})), "forward", forbidden("forward")),
    "one forbidden": (with_release(forbidden=frozenset({"forward"})), "backward", ""),
}  # fmt: skip


@pytest.mark.parametrize(("given", "direction", "refusal"), CASES.values(), ids=CASES)
def test_a_release_moves_or_is_refused_with_the_reason(
    given: Given, direction: Direction, refusal: str
) -> None:
    fixture = hit()
    given(fixture)
    assert fixture.hold(direction) == refusal
    fixture.tick()
    assert fixture.hold(direction) == refusal
    sign = 1 if direction == "forward" else -1
    assert sign * fixture.verdict.twist.linear > 0 if not refusal else fixture.verdict.twist.is_zero
    assert (fixture.published().release_refusal, fixture.verdict.source) == (refusal, "teleop")


def test_without_a_contact_there_is_no_release() -> None:
    fixture = PolicyFixture().ready()
    assert fixture.hold() == "There is no contact to release."
    assert fixture.verdict.twist.is_zero
    assert fixture.let_go().command == "run"
    assert fixture.state.release.refusal == ()


def test_only_an_operator_releases() -> None:
    fixture = hit()
    fixture.tick(20)
    fixture.request(source="nav")
    fixture.tick()
    assert fixture.hold(source="nav") == PROGRAM
    assert fixture.verdict.command == "brake"
    fixture.let_go()
    assert fixture.hold("backward", 5) == ""
    assert fixture.request(source="nav", release="forward").twist.linear < 0  # of lower priority


# --- beginning, ending ---------------------------------------------------------------------------


@pytest.mark.parametrize("held", ["backward", "forward"])
def test_a_key_that_was_held_into_the_contact_moves_nothing(held: Direction) -> None:
    fixture = PolicyFixture().running()
    fixture.request(release=held)
    fixture.pressed = True
    fixture.linear = 0.0
    for _ in range(60):
        fixture.tick()
        fixture.hold(held)
        assert fixture.verdict.command == "brake"
    assert render(fixture.state.release.refusal) == LET_GO
    fixture.let_go()
    assert fixture.hold(held, 5) == ""
    assert fixture.verdict.command == "run"


@pytest.mark.parametrize(
    ("given", "over"),
    [
        (feed(link=link(state="lost")), settled),
        (silent, settled),
        (press_anew, nothing),
        (freed, feed(pressed=True)),
    ],
)
def test_what_ended_a_release_wants_a_neutral_request_before_the_next(
    given: Given, over: Given
) -> None:
    fixture = hit()
    fixture.hold("forward", 5)
    assert fixture.verdict.command == "run"
    given(fixture)
    assert fixture.hold("backward", 1)
    assert fixture.verdict.command != "run"
    over(fixture)
    assert fixture.hold("backward", 5) == LET_GO
    assert fixture.verdict.command != "run"
    fixture.let_go()
    assert fixture.hold("backward", 5) == ""
    assert fixture.verdict.command == "run"


def test_the_vehicle_is_waited_for_until_it_stands() -> None:
    fixture = hit()
    feed(linear=-0.05)(fixture)
    assert fixture.hold("backward", 5) == MOVES
    fixture.linear = 0.0
    assert fixture.hold("backward", 2) == ""
    assert fixture.verdict.command == "run"
    fixture.linear = -0.3  # it moves on by itself
    assert fixture.hold("backward", 2) == ""


def test_a_release_that_is_let_go_or_silent_ends() -> None:
    fixture = hit()
    fixture.hold("backward", 5)
    assert fixture.let_go().command == "brake"
    fixture.hold("backward", 5)
    assert fixture.tick(15).command == "run"  # the lease of its source
    assert fixture.tick().command == "brake"
    fixture.tick(2)
    assert fixture.hold() == LET_GO  # it has come to rest without a request
    assert fixture.tick(5).command == "brake"


def test_a_change_of_direction_begins_at_rest() -> None:
    fixture = hit()
    fixture.linear = 0.0  # held by what it hit: measured, it stands all the time
    fixture.hold("backward", 10)
    assert fixture.hold("forward") == LET_GO
    assert fixture.verdict.command == "brake"
    assert fixture.hold("forward", 10) == LET_GO
    fixture.let_go()
    for _ in range(10):
        fixture.tick()
        assert fixture.hold("forward") == ""
        assert fixture.verdict.twist.linear >= 0
    assert fixture.verdict.twist.linear > 0


def test_late_and_repeated_requests_move_nothing() -> None:
    fixture = hit()
    old = fixture.echo
    fixture.tick(21)
    fixture.request(echo=old)
    assert fixture.refused == "late"
    for _ in range(20):
        fixture.request(release="backward", echo=old)
        assert fixture.refused == "late"
        assert fixture.verdict.command == "brake"
    fixture.let_go()
    fixture.hold()
    assert fixture.tick(3).command == "run"
    fixture.driver_seq -= 1
    fixture.request(release="forward")
    assert fixture.refused == "seq_not_rising"
    assert fixture.verdict.command == "run"


@pytest.mark.parametrize("asked", ["none", *DIRECTIONS])
def test_a_higher_source_ends_a_release_and_continues_none(asked: ReleaseRequest) -> None:
    fixture = hit()
    fixture.tick()
    fixture.driver_boot = 5
    fixture.request(source="web")
    fixture.tick(16)
    assert fixture.hold(source="web") == LET_GO  # overruled by the zeros of teleop
    fixture.now_ns += 1
    fixture.request(source="web")
    assert fixture.hold("backward", 3, source="web") == ""
    assert fixture.verdict.source == "web"
    fixture.driver_boot = 99
    assert fixture.request(release=asked).command == "brake"
    assert fixture.verdict.source == "teleop"
    assert render(fixture.state.release.refusal) == ("" if asked == "none" else LET_GO)


@pytest.mark.parametrize("rear", [0.1, None])
def test_a_release_obeys_the_sonars(rear: float | None) -> None:
    fixture = hit()
    fixture.sonar(rear=rear)
    fixture.let_go(60)  # no operator's override is for a release
    assert fixture.hold("backward", 3) == ""
    assert fixture.verdict.command == "stop"
    texts = {
        0.1: "No room toward the rear: 0.10 m.",
        None: "No motion toward the rear: that sonar is faulty.",
    }
    assert fixture.text("blocked") == texts[rear]


# --- how far, and where --------------------------------------------------------------------------


@pytest.mark.parametrize(("direction", "sign"), [("forward", 1), ("backward", -1)])
@pytest.mark.parametrize("slip", [0.0, 0.006])
def test_a_release_moves_no_farther_than_its_distance(
    direction: Direction, sign: int, slip: float
) -> None:
    fixture, began = hit(), hit().distance
    while not fixture.hold(direction):
        fixture.tick()
        fixture.distance += sign * slip  # of the counters, beyond the reported velocity
        assert 0 <= sign * fixture.verdict.twist.linear <= 0.1 + 1e-9
        assert fixture.verdict.twist.angular == 0
    fixture.tick(40)
    assert 0.1 < sign * (fixture.distance - began) <= 0.15
    for clear in (1, 10):
        press_anew(fixture, clear)
        for either in DIRECTIONS:
            fixture.let_go()
            assert fixture.hold(either) == USED_UP_TEXT
    assert fixture.tick().command == "brake"
    assert "contact" in latched(fixture.state.latches)


def test_pressed_again_while_it_moves_off_it_goes_no_farther_that_way() -> None:
    fixture = hit()
    assert fixture.hold("backward", 30) == ""
    press_anew(fixture, 5)
    for _ in range(30):
        fixture.let_go()
        assert fixture.hold() == forbidden("backward")
        assert fixture.tick().command == "brake"
    release = fixture.release()
    assert (release.believed_free, release.forbidden) == (None, ("backward",))
    assert 0 < release.left < 0.1
    fixture.let_go()
    assert fixture.hold("forward", 5) == ""
    assert fixture.verdict.twist.linear > 0
    press_anew(fixture)
    fixture.tick(40)
    for either in DIRECTIONS:
        fixture.let_go()
        assert fixture.hold(either) == BOTH
    fixture.let_go()
    assert fixture.reset() == f"Still present: {CAUSES['contact'].text[0]} {BOTH}"


def test_the_advice_names_only_the_direction_that_is_left() -> None:
    check = "The vehicle drove forward into the contact: check that direction first."
    for pressed_again, advice in (
        ("backward", f"Hold F to move off forward. {check}"),
        ("forward", "Hold B to move off backward."),
    ):
        fixture = hit()
        fixture.hold(pressed_again, 10)  # type: ignore[arg-type]
        press_anew(fixture)
        fixture.tick(40)
        assert fixture.reset() == f"Still present: The bumper was hit. {advice}"


def test_a_reset_and_a_new_contact_have_the_way_anew() -> None:
    fixture = hit()
    fixture.hold("backward", 30)
    press_anew(fixture)
    feed(pressed=False)(fixture)
    fixture.let_go(20)
    assert fixture.published().release is not None
    assert fixture.reset() == ""
    assert fixture.published().release is None
    feed(pressed=True)(fixture)
    release = fixture.release()
    assert release.forbidden == ()
    assert release.left == pytest.approx(0.15 - 0.027 - 0.1**2 / 1.2)
    fixture.let_go(2)
    assert fixture.hold() == ""


# --- the direction that is believed free ---------------------------------------------------------


def test_a_rebound_before_the_bumper_does_not_choose_the_direction() -> None:
    fixture = PolicyFixture().running()
    fixture.linear = -0.05
    fixture.tick(2)
    fixture.pressed = True
    fixture.tick()
    fixture.linear = 0.0
    fixture.tick(40)
    release = fixture.release()
    assert release.believed_free == "backward"
    assert release.travelled == pytest.approx(0.75, abs=0.03)
    assert release.age == pytest.approx(0.86, abs=0.05)


def test_a_contact_after_an_hour_reports_the_age_and_nothing_moves_by_itself() -> None:
    fixture = PolicyFixture().running()
    fixture.drive(0.0, seconds=2)
    fixture.now_ns += 3600 * NS_PER_S
    fixture.tick(60)
    assert fixture.reset() == ""  # an emergency stop may have been missed
    fixture.pressed = True
    fixture.let_go(40)
    release = fixture.release()
    assert release.believed_free == "backward"
    assert release.age is not None
    assert release.age > 3600
    assert fixture.verdict.command == "brake"
    assert fixture.hold("forward", 10) == ""
    assert fixture.verdict.twist.linear > 0


def test_a_second_contact_looks_at_the_travel_between() -> None:
    fixture = hit()
    fixture.hold("backward", 20)
    fixture.pressed = False
    fixture.tick(60)
    fixture.linear = -0.5  # pushed by hand
    fixture.tick(100)
    fixture.linear = None
    fixture.pressed = True
    fixture.tick(2)
    release = fixture.release()
    assert release.believed_free == "forward"
    assert release.travelled == pytest.approx(-1.03, abs=0.01)


def test_without_counters_a_contact_is_held_too() -> None:
    fixture = PolicyFixture()
    fixture.muted = {"mileage"}
    fixture.running()
    fixture.pressed = True
    assert fixture.tick(3).command == "brake"
    assert fixture.published().release is not None


def test_a_neutral_request_at_the_time_of_the_press_is_not_newer() -> None:
    fixture = PolicyFixture().running()
    fixture.pressed, fixture.linear = True, 0.0
    fixture.feed()
    fixture.request(0.0)
    fixture.tick()
    fixture.request(release="forward")
    assert render(fixture.state.release.refusal) == LET_GO
