"""Rounds: states, what stops them, and how they go on."""

import math
from collections.abc import Callable

import msgspec
import pytest

from common.pose import Pose
from services.patrol.core.course import RULES, STATES, TICK_S, OpenRound
from services.patrol.core.patrol import Patrol
from services.patrol.core.teaching import Refused
from t2 import messages as m
from tests.patrol.core.vehicle_fixture import (
    ANNOUNCE_S,
    LOOP,
    PATIENCE_S,
    Vehicle,
    route,
    vehicle_in,
)

ACTIVE: tuple[m.RoundState, ...] = ("announcing", "driving", "staying", "waiting", "returning")


def test_a_loop_ends_at_home_and_its_stations_are_visited() -> None:
    vehicle = Vehicle()
    assert vehicle.start(route(LOOP, stay=2.0)) is None
    vehicle.until("staying")
    assert vehicle.message.station == "gate"
    vehicle.until("done")
    record = vehicle.patrol.course and vehicle.patrol.course.diary.record
    assert record
    assert (record.result, [each.station for each in record.visits]) == ("home", ["gate", "home"])
    assert record.distance == pytest.approx(14.0, abs=0.5)
    assert record.deviation < 0.3
    assert math.dist((vehicle.at.x, vehicle.at.y), (0.0, 0.0)) < 0.1
    assert vehicle.events == ["round_start", "station", "round_end"]


def test_an_open_route_is_driven_back_home() -> None:
    vehicle = Vehicle()
    assert vehicle.start() is None
    vehicle.until("returning")
    assert vehicle.message.homeward
    vehicle.until("done")
    assert vehicle.reasons == ("patrol.home",)
    assert math.dist((vehicle.at.x, vehicle.at.y), (0.0, 0.0)) < 0.1


def test_after_the_last_station_of_an_open_route_the_next_one_is_home() -> None:
    vehicle = Vehicle()
    assert vehicle.start(route(((0.0, 0.0, "home"), (2.0, 0.0, "gate"), (4.0, 0.0)))) is None
    vehicle.until("driving")
    assert vehicle.message.station == "gate"
    while vehicle.at.x < 3.0:
        vehicle.run(0.1)
    assert (vehicle.state, vehicle.message.station) == ("driving", "home")
    assert vehicle.message.text == "Driving yard; the next station is home."


def test_nothing_moves_before_the_announcement_is_over() -> None:
    vehicle = vehicle_in("announcing")
    vehicle.run(0.8)
    assert not vehicle.requests
    vehicle.run(1.0)
    assert vehicle.moves


@pytest.mark.parametrize("heading", [0.0, 1.6, math.pi, -2.0])
def test_a_round_begins_at_any_heading_by_a_turn_on_the_spot(heading: float) -> None:
    vehicle = Vehicle(Pose(0.0, 0.0, heading))
    assert vehicle.start() is None
    vehicle.until("done")
    record = vehicle.patrol.course and vehicle.patrol.course.diary.record
    assert record
    assert record.deviation < 0.3


@pytest.mark.parametrize(
    ("at", "sigma", "reason"),
    [
        (Pose(0.2, 0.1, 0.0), 0.05, None),
        (Pose(0.0, 2.0, 0.0), 0.05, "patrol.not_home"),
        (Pose(4.0, 0.0, 0.0), 0.05, "patrol.not_home"),
        (Pose(0.2, 0.0, 0.0), 0.2, "patrol.uncertain"),
        (Pose(0.25, 0.0, 0.0), 0.125, None),  # the corridor of 0.5 m is used up
        (Pose(0.0, 0.25, 0.0), 0.125, None),
        (Pose(0.5, 0.0, 0.0), 0.05, "patrol.uncertain"),
    ],
)
def test_a_round_begins_only_at_home(at: Pose, sigma: float, reason: str | None) -> None:
    vehicle = Vehicle(at)
    vehicle.sigma = sigma
    assert vehicle.start() == reason


def test_a_round_begins_at_home_and_not_where_its_route_comes_back_to() -> None:
    back = ((0.0, 0.0, "home"), (2.6, 0.0), (2.6, 0.3), (0.0, 0.3, "gate"))  # after 5.5 m
    vehicle = Vehicle(Pose(0.0, 0.2, 0.0))
    assert vehicle.start(route(back)) is None
    assert vehicle.patrol.course
    assert vehicle.patrol.course.along == 0.0


def test_a_round_that_is_paused_before_its_first_tick_halts_at_home() -> None:
    vehicle = Vehicle()
    assert vehicle.start() is None
    assert vehicle.patrol.act("pause", vehicle.now_ns, vehicle.wall_ns) is None
    vehicle.run(1.0)
    assert vehicle.act("abort") is None
    assert vehicle.patrol.course
    (halt,) = vehicle.patrol.course.diary.record.halts
    assert (halt.state, halt.x, halt.y) == ("paused", 0.0, 0.0)


def test_a_route_of_another_robot_is_refused() -> None:
    assert Vehicle().start(route(robot="002")) == "patrol.other_robot"


def test_a_restored_round_of_another_robot_is_not_resumed() -> None:
    vehicle = Vehicle().driving()
    course = vehicle.patrol.course
    assert course
    vehicle.patrol = Patrol("002", ANNOUNCE_S, PATIENCE_S)
    vehicle.patrol.restore(course.open, course.route, vehicle.wall_ns)
    assert [vehicle.act(each) for each in ("resume", "return")] == ["patrol.other_robot"] * 2
    assert vehicle.act("abort") is None


def test_one_round_at_a_time() -> None:
    vehicle = vehicle_in("driving")
    assert vehicle.start() == "patrol.busy"
    vehicle.act("pause")
    assert vehicle.start() == "patrol.busy"
    vehicle.act("abort")
    vehicle.at = Pose(0.0, 0.0, 0.0)
    assert vehicle.start() is None


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("action", ["depart", "pause", "resume", "return", "abort"])
def test_only_the_listed_actions_are_possible(state: m.RoundState, action: m.RoundAction) -> None:
    vehicle = vehicle_in(state)
    is_possible = action in vehicle.message.actions
    assert (vehicle.act(action) is None) == is_possible
    assert is_possible == (action in STATES[state].actions)


@pytest.mark.parametrize("state", ACTIVE)
def test_an_emergency_stop_stops_a_round_and_a_reset_does_not_resume_it(
    state: m.RoundState,
) -> None:
    vehicle = vehicle_in(state)
    vehicle.causes, vehicle.latched = (), ("estop",)
    vehicle.run(0.2)
    assert vehicle.state == "stopped"
    assert vehicle.act("resume") == "patrol.latched"
    vehicle.latched = ()
    vehicle.run(5.0)
    assert (vehicle.state, vehicle.moves) == ("stopped", False)
    assert vehicle.act("resume") is None
    vehicle.until("done")


def test_a_round_begins_only_where_safety_would_let_it_move() -> None:
    vehicle = Vehicle()
    vehicle.causes = ("switches",)
    assert vehicle.start() == "patrol.forbidden"
    vehicle.causes = ("limit_stop",)
    assert vehicle.start() is None


def test_a_latch_that_is_reset_between_two_ticks_stops_too() -> None:
    vehicle = vehicle_in("driving")
    vehicle.latched = ("estop",)
    vehicle.patrol.on_safety(vehicle._state(), vehicle.now_ns)
    vehicle.latched = ()
    vehicle.run(0.5)
    assert vehicle.state == "stopped"


Trouble = Callable[[Vehicle], None]
TROUBLES: dict[str, tuple[Trouble, str]] = {
    "safety silent": (lambda it: it.silent.add("safety"), "patrol.safety_silent"),
    "localization silent": (lambda it: it.silent.add("localization"), "patrol.map_silent"),
    "safety restarts": (lambda it: it.boots.update(safety=2), "patrol.safety_restarted"),
    "localization restarts": (lambda it: it.boots.update(localization=2), "patrol.map_restarted"),
    "placed anew": (lambda it: setattr(it, "placement", 2), "patrol.placed"),
    "position lost": (lambda it: setattr(it, "map_state", "lost"), "map.uncertain"),
    "not placed any more": (lambda it: setattr(it, "map_state", "unplaced"), "map.unplaced"),
    "another patrol": (lambda it: it.patrol.on_other(it.now_ns), "patrol.twice"),
    "computer sleeps": (lambda it: setattr(it, "now_ns", it.now_ns + 60 * 10**9), "patrol.held_up"),
}


@pytest.mark.parametrize("state", ACTIVE)
@pytest.mark.parametrize("trouble", TROUBLES)
def test_what_needs_a_person_stops_a_round(state: m.RoundState, trouble: str) -> None:
    vehicle = vehicle_in(state)
    cause, reason = TROUBLES[trouble]
    cause(vehicle)
    vehicle.run(3.0)
    assert (vehicle.state, vehicle.reasons) == ("stopped", (reason, "patrol.resume"))
    vehicle.silent.clear()
    vehicle.map_state, vehicle.causes = "placed", ()
    vehicle.run(5.0)
    assert (vehicle.state, vehicle.moves) == ("stopped", False)
    assert vehicle.act("resume") is None
    vehicle.until("done")


@pytest.mark.parametrize("state", ACTIVE)
def test_another_source_pauses_a_round_and_its_end_does_not_resume_it(state: m.RoundState) -> None:
    vehicle = vehicle_in(state)
    vehicle.causes, vehicle.source = (), "teleop"
    vehicle.run(1.0)
    assert (vehicle.state, vehicle.reasons) == ("paused", ("patrol.overruled",))
    assert vehicle.act("resume") == "patrol.other_drives"
    vehicle.source = None
    vehicle.run(5.0)
    assert (vehicle.state, vehicle.moves) == ("paused", False)
    assert vehicle.act("resume") is None
    vehicle.until("done")


def test_a_halt_is_noted_where_the_vehicle_is() -> None:
    vehicle = Vehicle(Pose(0.1, 0.2, 0.0))
    assert vehicle.start() is None
    vehicle.source = "teleop"
    vehicle.run(1.0)
    vehicle.source = None
    vehicle.act("abort")
    record = vehicle.patrol.course and vehicle.patrol.course.diary.record
    assert record
    assert [(each.state, each.x, each.y) for each in record.halts] == [("paused", 0.1, 0.2)]


def test_every_rule_is_the_reason_of_a_tested_stop() -> None:
    assert len(RULES) == 8  # add a case above for a new one


@pytest.mark.parametrize(
    ("push", "turn", "reason"), [(0.3, 1.5, None), (-0.3, 3.0, None), (3.0, 0.0, "patrol.outside")]
)
def test_a_pushed_vehicle_resumes_only_inside_the_corridor(
    push: float, turn: float, reason: str | None
) -> None:
    vehicle = vehicle_in("paused")
    vehicle.push(y=push, turn=turn)
    assert vehicle.act("resume") == reason
    if reason is None:
        vehicle.until("done")


@pytest.mark.parametrize("along", [2.5, -0.9])
def test_a_vehicle_that_was_moved_along_the_route_goes_on_from_there(along: float) -> None:
    vehicle = vehicle_in("paused")
    vehicle.push(x=along)
    assert vehicle.act("resume") is None
    vehicle.until("returning")
    record = vehicle.patrol.course and vehicle.patrol.course.diary.record
    assert record
    assert [each.station for each in record.visits] == ["gate"]


@pytest.mark.parametrize(("past", "visits"), [(0.5, ["gate"]), (2.5, []), (4.5, [])])
def test_a_vehicle_that_was_moved_past_a_station_goes_on(past: float, visits: list[str]) -> None:
    corner = (8.5, 5.0)
    vehicle = Vehicle().driving(route(((0.0, 0.0, "home"), (4.0, 0.0, "gate"), (8.5, 0.0), corner)))
    vehicle.run(5.0)
    assert vehicle.act("pause") is None
    vehicle.at = Pose(4.0 + past, 0.0, 0.0)
    assert vehicle.act("resume") is None
    vehicle.until("returning")
    record = vehicle.patrol.course and vehicle.patrol.course.diary.record
    assert record
    assert [each.station for each in record.visits] == visits


@pytest.mark.parametrize("cause", ["blocked", "limit_stop"])
def test_it_waits_and_goes_on_by_itself(cause: m.CauseName) -> None:
    vehicle = vehicle_in("driving")
    vehicle.causes = (cause,)
    vehicle.run(1.0)
    assert (vehicle.state, vehicle.reasons) == ("waiting", ("patrol.waiting", "blocked"))
    assert vehicle.moves == (cause == "blocked")  # the others want a neutral request
    vehicle.causes = ()
    vehicle.until("done")
    record = vehicle.patrol.course and vehicle.patrol.course.diary.record
    assert record
    assert [each.state for each in record.halts] == ["waiting"]
    assert record.halts[0].seconds == pytest.approx(1.5, abs=0.3)


@pytest.mark.parametrize(
    ("blocked", "state"), [("wait", "waiting"), ("return", "waiting"), ("stop", "stopped")]
)
def test_after_its_patience_a_round_does_what_the_route_says(
    blocked: m.WhenBlocked, state: m.RoundState
) -> None:
    vehicle = Vehicle().driving(route(blocked=blocked))
    vehicle.causes = ("blocked",)
    vehicle.run(PATIENCE_S + 2.0)
    assert vehicle.state == state
    assert blocked != "wait" or vehicle.reasons == ("patrol.blocked", "blocked")
    assert vehicle.message.homeward == (blocked == "return")
    assert vehicle.events.count("round_blocked") == (blocked != "stop")
    vehicle.run(PATIENCE_S + 2.0)
    assert vehicle.state == state
    vehicle.causes = ()
    if state == "waiting":
        vehicle.until("done")
        assert vehicle.reasons == ("patrol.returned" if blocked == "return" else "patrol.home",)


@pytest.mark.parametrize("turns", [False, True])
def test_a_pose_that_does_not_change_stops_within_a_metre(turns: bool) -> None:
    vehicle = Vehicle(Pose(0.0, 0.0, 3.0)) if turns else Vehicle()
    assert vehicle.start() is None
    vehicle.run(2.5 if turns else 4.0)
    place, before = vehicle.at, len(vehicle.requests)
    for _ in range(400):
        vehicle.at = place
        vehicle.step()
    driven = sum(each.linear for each in vehicle.requests[before:]) * TICK_S
    turned = sum(abs(each.angular) for each in vehicle.requests[before:]) * TICK_S
    assert vehicle.reasons == ("patrol.frozen", "patrol.resume")
    assert driven < 1.2
    assert turned < 1.7
    assert turned > 1.3 if turns else driven > 0.8


def test_a_vehicle_that_does_not_get_on_though_the_way_is_free_stops() -> None:
    vehicle = vehicle_in("driving")
    place = vehicle.at
    for step in range(round((PATIENCE_S + 1) / 0.05)):
        vehicle.at = Pose(place.x, place.y + 0.15 * (step % 2), place.heading)  # it swings
        vehicle.step()
    assert vehicle.reasons == ("patrol.stuck", "patrol.resume")


def test_a_safety_that_does_not_know_the_source_is_named() -> None:
    vehicle = Vehicle()
    assert vehicle.start() is None
    vehicle.run(1.0)
    place = vehicle.at
    for _ in range(100):
        vehicle.at, vehicle.requests = place, []  # without requests safety names no source
        vehicle.step()
    assert vehicle.reasons == ("patrol.unheard", "patrol.resume")


@pytest.mark.parametrize(
    ("y", "sigma", "reason"),
    [
        (0.0, 0.24, None),
        (0.0, 0.26, "patrol.uncertain"),
        (0.5, 0.05, "patrol.uncertain"),
        (0.6, 0.05, "patrol.outside"),
    ],
)
def test_it_stops_where_it_cannot_be_sure_to_be_in_the_corridor(
    y: float, sigma: float, reason: str | None
) -> None:
    vehicle = vehicle_in("driving")
    vehicle.push(y=y)
    vehicle.sigma = sigma
    vehicle.run(0.2)
    assert vehicle.state == ("driving" if reason is None else "stopped")
    assert reason is None or vehicle.reasons[0] == reason


def test_a_stay_ends_by_a_call() -> None:
    vehicle = vehicle_in("staying")
    assert vehicle.message.left == 5.0
    assert vehicle.act("depart") is None
    assert vehicle.state == "driving"
    vehicle.until("done")


def test_it_stays_at_the_end_of_an_open_route() -> None:
    vehicle = Vehicle()
    assert vehicle.start(route(stay=2.0)) is None
    vehicle.until("staying")
    assert (vehicle.message.station, vehicle.message.homeward) == ("gate", True)
    vehicle.until("returning")


def test_a_short_stop_is_no_waiting() -> None:
    vehicle = vehicle_in("driving")
    vehicle.causes = ("limit_stop",)
    vehicle.run(0.3)
    vehicle.causes = ()
    vehicle.run(2.0)
    assert (vehicle.state, vehicle.events) == ("driving", ["round_start"])


def test_a_stop_at_the_end_of_the_patience_is_waited_for() -> None:
    vehicle = vehicle_in("driving")
    place = vehicle.at
    for step in range(round((PATIENCE_S + 3.0) / TICK_S)):
        vehicle.at = Pose(place.x, place.y + 0.15 * (step % 2), place.heading)  # it swings
        vehicle.causes = ("blocked",) if step * TICK_S > PATIENCE_S - 0.5 else ()
        vehicle.step()
    assert vehicle.reasons == ("patrol.blocked", "blocked")


def test_a_station_that_is_reached_while_waiting_is_visited() -> None:
    vehicle = Vehicle().driving(route(LOOP), until_x=3.0)
    vehicle.causes = ("limit_stop",)
    vehicle.until("waiting")
    vehicle.push(x=4.0 - vehicle.at.x)
    vehicle.run(0.5)
    assert (vehicle.state, vehicle.message.station) == ("waiting", "home")
    assert vehicle.events.count("round_waiting") == 1
    vehicle.causes = ()
    vehicle.until("done")


def test_nothing_begins_without_safety_and_a_pose() -> None:
    vehicle = Vehicle()
    start = vehicle.patrol.start
    assert start(route(), "one", "", vehicle.now_ns, 0) == m.Phrase("patrol.safety_silent")
    vehicle.silent.add("localization")
    assert vehicle.start() == "patrol.map_silent"


def test_nothing_begins_while_another_patrol_service_runs() -> None:
    vehicle = Vehicle()
    vehicle.patrol.on_other(vehicle.now_ns)
    assert vehicle.start() == "patrol.twice"
    assert vehicle.act("resume") == "patrol.twice"  # the other one has the round
    assert vehicle.act("pause") == "patrol.not_now"
    assert vehicle.reasons == ("patrol.twice",)
    with pytest.raises(Refused, match=r"patrol\.twice"):
        vehicle.patrol.begin("hall", "home", 0.0, vehicle.now_ns)
    vehicle.run(2.5)
    assert vehicle.reasons == ("patrol.idle",)
    assert vehicle.start() is None


def test_two_stations_at_one_place_are_both_visited() -> None:
    points = [(0.0, 0.0, "home"), (2.0, 0.0, "door"), (2.0, 0.0, "window"), (0.0, 0.0)]
    vehicle = Vehicle()
    assert vehicle.start(route(points)) is None
    vehicle.until("done")
    record = vehicle.patrol.course and vehicle.patrol.course.diary.record
    assert record
    assert [each.station for each in record.visits] == ["door", "window", "home"]


def test_a_route_that_crosses_itself_is_driven_in_its_order() -> None:
    eight = [(0.0, 0.0, "home"), (4.0, 4.0, "far"), (4.0, 0.0), (0.0, 4.0, "end"), (0.0, 0.0)]
    vehicle = Vehicle()
    assert vehicle.start(route(eight)) is None
    vehicle.until("done", within=240)
    record = vehicle.patrol.course and vehicle.patrol.course.diary.record
    assert record
    assert [each.station for each in record.visits] == ["far", "end", "home"]
    assert record.distance > 17


def test_returning_is_backward_along_the_route() -> None:
    vehicle = Vehicle()
    assert vehicle.start(route(LOOP)) is None
    while vehicle.at.y < 1.0:
        vehicle.step()
    assert vehicle.act("return") is None
    vehicle.until("done")
    assert vehicle.reasons == ("patrol.returned",)
    record = vehicle.patrol.course and vehicle.patrol.course.diary.record
    assert record
    assert record.deviation < 0.3


def test_no_corner_is_cut_after_a_turn_close_to_it() -> None:
    vehicle = Vehicle()
    assert vehicle.start(route(LOOP)) is None
    while vehicle.at.x > 0.05 or not 2.0 < vehicle.at.y < 2.5:  # on the last leg
        vehicle.step()
    assert vehicle.act("return") is None
    vehicle.until("done")
    record = vehicle.patrol.course and vehicle.patrol.course.diary.record
    assert record
    assert record.deviation < 0.1


@pytest.mark.parametrize("state", [*ACTIVE, "paused", "stopped"])
def test_a_restarted_service_waits_for_a_person(state: m.RoundState) -> None:
    vehicle = vehicle_in(state)
    course = vehicle.patrol.course
    assert course
    after = Vehicle(vehicle.at)
    after.placement = vehicle.placement
    opened = msgspec.json.decode(msgspec.json.encode(course.open), type=OpenRound)
    after.patrol.restore(opened, course.route, after.wall_ns)
    after.run(5.0)
    assert (after.state, after.moves) == ("stopped", False)
    assert after.reasons == ("patrol.restarted", "patrol.resume")
    assert after.message.progress == pytest.approx(vehicle.message.progress)
    assert after.message.homeward == vehicle.message.homeward == (state == "returning")
    assert after.act("resume") is None
    after.until("done")
    assert after.patrol.course
    record = after.patrol.course.diary.record
    assert (record.id, record.result) == ("one", "returned" if state == "returning" else "home")
