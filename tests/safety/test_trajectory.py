"""Travel by the counters: what is remembered, what is forgotten, and which direction results."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import Latest
from common.messages import Mileage
from services.safety.core.causes import Held
from services.safety.trajectory import OPPOSITE, REACH_M, STEP_M, Approach, Trajectory


def at(distance: float, heading: float = 0.0, boot: int = 7, epoch: int = 0) -> Mileage:
    return Mileage(distance=distance, heading=heading, boot=boot, epoch=epoch)


def travel(*positions: float, heading: float = 0.0) -> Trajectory:
    """Follow counters that read these distances, one second apart."""
    trajectory = Trajectory()
    for second, distance in enumerate(positions):
        trajectory = trajectory.follow(Latest(at(distance, heading), second))
    return trajectory


def test_the_first_reading_is_no_travel() -> None:
    assert travel(50.0) == Trajectory(at=at(50.0, 0.0))
    assert Trajectory().direction is None
    assert Trajectory().net == 0


@pytest.mark.parametrize(
    ("positions", "runs"),
    [
        ((0.0, 0.005), (0.005,)),
        ((0.0, 0.0049), ()),
        ((0.0, 0.003, 0.006), (0.006,)),  # small steps add up
        ((0.0, -0.2, -0.5), (-0.5,)),
        ((0.0, 0.3, 0.2), (0.3, -0.1)),
        ((0.0, 0.3, 0.2, 0.1), (0.3, -0.2)),
        ((0.0, 1.0), (1.0,)),
        ((0.0, 0.8, 1.5), (1.0,)),  # the reach
        ((0.0, 0.8, 0.2, 0.6), (-0.6, 0.4)),  # what lies exactly behind the reach is left out
        ((0.0, 0.8, 0.2, 0.5), (0.1, -0.6, 0.3)),
        ((0.0, 0.2, 0.1, 1.1), (1.0,)),
    ],
)
def test_runs_of_one_sign(positions: tuple[float, ...], runs: tuple[float, ...]) -> None:
    assert travel(*positions).runs == pytest.approx(runs)


@pytest.mark.parametrize(("boot", "epoch"), [(8, 0), (7, 1)])
def test_another_bridge_or_a_restarted_board_begins_anew(boot: int, epoch: int) -> None:
    other = at(0.6, boot=boot, epoch=epoch)
    assert travel(0.0, 0.5).follow(Latest(other, 9)) == Trajectory(at=other)


def contact(identity: int) -> Held:
    return Held(1, 1, 0, (1, 1), "hit", identity)


def test_only_a_new_contact_takes_the_trajectory() -> None:
    approach = Approach()
    for distance, held, direction in [
        (0.0, None, None),
        (0.4, contact(3), "forward"),  # the reading of the contact counts
        (-0.4, contact(3), "forward"),
        (-0.4, None, "forward"),
        (-0.4, contact(9), "backward"),
    ]:
        approach = approach.follow(Latest(at(distance), 5), held)
        assert approach.before.direction == direction
    assert approach.follow(None, contact(9)) == approach


@pytest.mark.parametrize(("turned", "stays"), [(0.35, True), (-0.35, True), (0.36, False)])
def test_a_turn_on_the_spot_forgets_earlier_travel(turned: float, stays: bool) -> None:
    begun = travel(0.0, 0.5)
    after = begun.follow(Latest(at(0.5, turned), 9))
    assert (after == begun) == stays
    assert (after == Trajectory(at=at(0.5, turned))) != stays


def test_the_heading_wraps() -> None:
    begun = travel(0.0, 0.5, heading=3.1)
    assert begun.follow(Latest(at(0.5, -3.1), 9)) == begun
    begun = travel(0.0, 0.5, heading=1.0)
    assert begun.follow(Latest(at(0.5, 1.1), 9)) == begun


def test_a_turn_while_it_travels_is_a_curve() -> None:
    trajectory = travel(0.0, 0.5).follow(Latest(at(0.51, 2.0), 9))
    assert trajectory.net == pytest.approx(0.51)
    assert trajectory.at == at(0.51, 2.0)


def test_the_end_is_when_the_counters_moved_last() -> None:
    trajectory = travel(0.0, 0.5)
    assert trajectory.ended_ns == 1
    assert trajectory.follow(Latest(at(0.501, 0.0), 9)).ended_ns == 1
    assert trajectory.follow(Latest(at(0.505, 0.0), 9)).ended_ns == 9


@pytest.mark.parametrize(
    ("positions", "direction"),
    [
        ((0.0, 0.5), "forward"),
        ((0.0, -0.5), "backward"),
        ((0.0, 0.05), "forward"),
        ((0.0, 0.049), None),  # too little travel
        ((0.0, 0.5, 0.451), "forward"),  # a rebound
        ((0.0, 0.5, 0.44), None),  # a run back: net forward, newest backward
        ((0.0, 0.5, 0.3), None),
        ((0.0, 0.5, -0.1), "backward"),
        ((0.0, 0.5, 0.0), None),
    ],
)
def test_the_direction_needs_net_travel_and_the_newest_run(
    positions: tuple[float, ...], direction: str | None
) -> None:
    assert travel(*positions).direction == direction


def test_there_are_two_directions() -> None:
    assert OPPOSITE == {"forward": "backward", "backward": "forward"}


@given(st.lists(st.floats(-2.0, 2.0), max_size=60))
def test_it_never_remembers_more_than_its_reach(positions: list[float]) -> None:
    runs = travel(*positions).runs
    assert sum(map(abs, runs)) <= REACH_M + 1e-9
    assert all(one * other < 0 for one, other in itertools.pairwise(runs))
    assert all(abs(run) >= STEP_M * 0.99 for run in runs[1:])
