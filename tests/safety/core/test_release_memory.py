"""The state of one latched contact: travel and forbidden directions."""

import pytest

from common.freshness import Latest
from common.motion import STILL, Twist
from services.safety.core.causes import Held
from services.safety.core.release import COAST_NS, Leg, Release, sweep
from t2.messages import Mileage

REACH = 0.65
BACK = Twist(-0.1)
BACKWARD = Release(direction="backward")
CLEARED, TOUCHED = (Held(1, 1, good, (1, 1), (), 40) for good in (1, 0))


def at(distance: float, epoch: int = 0, heading: float = 0.0, boot: int = 7) -> Mileage:
    return Mileage(distance=distance, heading=heading, epoch=epoch, boot=boot)


LEG = Leg(at(1.0), at(0.0), 5)


def moving(
    release: Release,
    sent: Twist | None = BACK,
    known: Twist | None = STILL,
    counter: Mileage | None = None,
    *,
    dt_s: float = 0.02,
    now_ns: int = 0,
) -> Release:
    return release.moving(sent, known, counter, reach=REACH, dt_s=dt_s, now_ns=now_ns)


@pytest.mark.parametrize(
    ("sent", "known", "travelled"),
    [
        (BACK, STILL, 0.05),
        (BACK, None, 0.05),
        (BACK, Twist(0.0, 0.4), 0.13),
        (BACK, Twist(-0.4), 0.2),
        (Twist(0.1), Twist(-0.02), 0.05),
    ],
)
def test_the_larger_speed_counts(sent: Twist, known: Twist | None, travelled: float) -> None:
    assert moving(Release(), sent, known, dt_s=0.5).travelled == pytest.approx(travelled)
    assert sweep(Twist(-0.1, -0.2), REACH) == pytest.approx(0.23)


def test_counters_that_cannot_be_compared_count_nothing() -> None:
    release = moving(Release(), counter=at(1.0))
    assert moving(release, counter=at(0.0, epoch=1), dt_s=0).travelled == pytest.approx(0.002)
    gap = moving(release, counter=None)
    assert moving(gap, counter=at(0.5)).counted == pytest.approx(0.5)  # across the gap


def test_only_a_release_and_its_coasting_count() -> None:
    idle = moving(Release(), sent=None, known=Twist(0.5), counter=at(1.0))
    assert (idle.travelled, idle.counter, idle.moved_ns) == (0.0, at(1.0), None)
    begun = moving(idle, counter=at(0.9))
    assert begun.counted == pytest.approx(0.1)
    assert begun.moved_ns == 0
    coasting = moving(begun, None, Twist(-0.1), at(0.8), dt_s=0.5, now_ns=COAST_NS)
    assert coasting.travelled == pytest.approx(0.2)
    assert coasting.moved_ns == COAST_NS
    over = moving(begun, None, Twist(-0.1), at(0.8), dt_s=0.5, now_ns=COAST_NS + 1)
    assert over.travelled == begun.travelled
    assert over.counter == at(0.8)


@pytest.mark.parametrize(
    ("later_ns", "forbidden"), [(COAST_NS, {"backward"}), (COAST_NS + 1, set())]
)
def test_a_press_during_a_release_forbids_its_direction(later_ns: int, forbidden: set[str]) -> None:
    used = moving(BACKWARD)
    after = used.after(CLEARED, TOUCHED, LEG, later_ns)
    assert after.forbidden == forbidden
    assert (after.direction, after.barred_ns) == (None, later_ns)
    assert after.travelled == used.travelled
    assert after.came == (used.came if forbidden else LEG)


# --- the direction that is believed free -----------------------------------------------------


def travel(*distances: float) -> Leg:
    """Follow counters that read these distances, one nanosecond apart."""
    leg = Leg()
    for now_ns, distance in enumerate(distances):
        leg = leg.follow(Latest(at(distance), now_ns))
    return leg


@pytest.mark.parametrize(
    ("distances", "travelled", "direction"),
    [
        ((), 0.0, None),
        ((3.0,), 0.0, None),
        ((0.0, 0.004), 0.0, None),  # noise
        ((0.0, 0.005), 0.005, None),
        ((0.0, 0.004, 0.008), 0.008, None),  # small steps add up
        ((0.0, 0.049), 0.049, None),  # too short
        ((0.0, 0.05), 0.05, "forward"),
        ((0.0, -0.2, -0.5), -0.5, "backward"),
        ((0.0, 0.5, 0.451), 0.5, "forward"),  # a rebound
        ((0.0, 0.5, 0.47, 0.44), -0.06, "backward"),
        ((0.0, 0.5, 0.3), -0.2, "backward"),
        ((0.0, 0.03, -0.04), -0.07, "backward"),
    ],
)
def test_the_direction_of_the_newest_leg(
    distances: tuple[float, ...], travelled: float, direction: str | None
) -> None:
    leg = travel(*distances)
    assert leg.travelled == pytest.approx(travelled)
    assert leg.direction == direction


@pytest.mark.parametrize(
    ("reading", "anew"),
    [
        (at(0.5, boot=8), True), (at(0.5, epoch=1), True),  # another bridge, a restarted board
        (at(0.5, heading=0.36), True), (at(0.5, heading=-0.36), True),  # a turn on the spot
        (at(0.5, heading=0.35), False), (at(0.504), False),
    ],
)  # fmt: skip
def test_a_restart_and_a_turn_on_the_spot_begin_a_leg(reading: Mileage, anew: bool) -> None:
    leg = travel(0.0, 0.5)
    assert leg.ended_ns == 1
    assert leg.follow(Latest(reading, 9)) == (Leg(reading, reading) if anew else leg)
    assert leg.follow(Latest(at(0.505), 9)).ended_ns == 9
    for before, after in ((3.0, -3.0), (1.0, 1.0)):  # past pi; the same heading
        turned = Leg(at(0.0, heading=before), at(0.5, heading=before), 1)
        assert turned.follow(Latest(at(0.5, heading=after), 9)) == turned


def test_without_a_direction_a_release_does_not_move() -> None:
    assert Release().away(0.1) == STILL
