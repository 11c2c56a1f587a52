"""The limits of a round: to the tick, since none of them may become longer by a step."""

import pytest

from common.freshness import NS_PER_S
from common.pose import Pose
from services.patrol.core.course import (
    BLOCKED_S,
    FREE_S,
    FRESH_S,
    OTHER_S,
    TICK_S,
    UNHEARD_S,
)
from services.patrol.core.inputs import SILENT_S
from t2 import messages as m
from tests.patrol.core.vehicle_fixture import (
    ANNOUNCE_S,
    LOOP,
    PATIENCE_S,
    TICK_NS,
    Vehicle,
    route,
    vehicle_in,
)

STREAMS = {"safety": "patrol.safety_silent", "localization": "patrol.map_silent"}


def around(vehicle: Vehicle, seconds: float) -> list[m.RoundState]:
    """Return the state after this time, and after one tick more."""
    vehicle.run(seconds)
    before = vehicle.state
    vehicle.step()
    return [before, vehicle.state]


@pytest.mark.parametrize("stream", STREAMS)
def test_a_round_begins_only_on_fresh_messages(stream: str) -> None:
    vehicle = Vehicle()
    vehicle.step()
    at_ns = vehicle.now_ns + round(FRESH_S * NS_PER_S)
    if stream == "safety":
        vehicle.patrol.on_pose(vehicle._pose(), at_ns)
    else:
        vehicle.patrol.on_safety(vehicle._state(), at_ns)
    refused = vehicle.patrol.start(route(), "one", "", at_ns + 1, vehicle.wall_ns)
    assert refused == m.Phrase(STREAMS[stream])
    assert vehicle.patrol.start(route(), "one", "", at_ns, vehicle.wall_ns) is None


@pytest.mark.parametrize("stream", STREAMS)
def test_on_old_messages_a_vehicle_stands_and_a_round_stops_later(stream: str) -> None:
    vehicle = vehicle_in("driving")
    vehicle.silent.add(stream)
    vehicle.run(FRESH_S)
    assert all(each.linear > 0 for each in vehicle.requests)
    vehicle.run(SILENT_S - FRESH_S)
    assert (vehicle.state, vehicle.moves) == ("driving", False)
    vehicle.step()
    assert vehicle.reasons == (STREAMS[stream], "patrol.resume")


@pytest.mark.parametrize(("gap_s", "state"), [(SILENT_S, "driving"), (2.01, "stopped")])
def test_a_round_stops_after_a_tick_that_is_too_late(gap_s: float, state: m.RoundState) -> None:
    vehicle = vehicle_in("driving")
    vehicle.now_ns += round(gap_s * NS_PER_S) - TICK_NS
    vehicle.step()
    assert vehicle.state == state


def test_an_announcement_and_a_stay_end_on_time() -> None:
    vehicle = Vehicle()
    assert vehicle.start(route(LOOP, stay=2.0)) is None
    assert vehicle.message.left == ANNOUNCE_S
    assert around(vehicle, ANNOUNCE_S - TICK_S) == ["announcing", "driving"]
    vehicle.until("staying")
    assert vehicle.message.left == 2.0
    assert around(vehicle, 2.0 - TICK_S) == ["staying", "driving"]


def test_another_source_for_a_moment_does_not_pause_a_round() -> None:
    vehicle = vehicle_in("driving")
    for _ in range(3):
        vehicle.source = "teleop"
        vehicle.run(OTHER_S + TICK_S)
        assert vehicle.state == "driving"
        vehicle.source = None
        vehicle.step()
    vehicle.source = "teleop"
    assert around(vehicle, OTHER_S + TICK_S) == ["driving", "paused"]


def test_a_round_without_effect_is_noticed_on_time() -> None:
    vehicle = Vehicle()
    assert vehicle.start() is None
    vehicle.run(ANNOUNCE_S)
    for _ in range(round(UNHEARD_S / TICK_S)):
        vehicle.requests = []  # without requests safety names no source
        vehicle.step()
    assert around(vehicle, 0.0) == ["driving", "stopped"]


def test_standing_because_of_an_old_pose_needs_no_effect() -> None:
    vehicle = Vehicle()
    assert vehicle.start() is None
    vehicle.run(ANNOUNCE_S)
    for step in range(round((UNHEARD_S + 0.5) / TICK_S)):
        vehicle.silent = {"localization"} if step * TICK_S < SILENT_S - TICK_S else set()
        vehicle.requests = []  # without requests safety names no source
        vehicle.step()
    assert vehicle.state == "driving"


def test_waiting_begins_and_ends_on_time() -> None:
    vehicle = vehicle_in("driving")
    vehicle.causes = ("blocked",)
    assert around(vehicle, BLOCKED_S + TICK_S) == ["driving", "waiting"]
    vehicle.causes = ()
    assert around(vehicle, FREE_S) == ["waiting", "driving"]


@pytest.mark.parametrize(("free_s", "state"), [(0.5, "waiting"), (1.5, "driving")])
def test_short_stops_add_up_unless_the_way_is_free_in_between(
    free_s: float, state: m.RoundState
) -> None:
    vehicle = vehicle_in("driving")
    for causes, seconds in ((("blocked",), 0.3), ((), free_s), (("blocked",), 0.3)):
        vehicle.causes = causes  # type: ignore[assignment]
        vehicle.run(seconds)
    assert vehicle.state == state


def test_the_patience_counts_from_the_last_progress() -> None:
    vehicle = vehicle_in("driving")
    vehicle.push(x=0.15)
    vehicle.causes = ("limit_stop",)
    vehicle.step()
    vehicle.run(3.0)
    assert (vehicle.state, vehicle.message.left) == ("waiting", PATIENCE_S - 3.0)


def test_a_round_begins_with_no_progress() -> None:
    vehicle = Vehicle(Pose(-0.25, 0.0, 0.0))
    assert vehicle.start() is None
    assert vehicle.message.progress == 0.0
    vehicle.until("driving")
    assert vehicle.message.progress == 0.0
