"""Who may ask for what, and when: rounds and routes together."""

from collections.abc import Callable

import pytest

from common.freshness import NS_PER_S
from common.pose import Pose
from services.patrol.core.course import FRESH_S, Note
from services.patrol.core.patrol import SPEED
from services.patrol.core.routes import length, stations
from services.patrol.core.teaching import OpenTeaching, Refused
from t2 import messages as m
from t2.messages import Phrase
from t2.words import render
from tests.patrol.core.vehicle_fixture import LINE, PATIENCE_S, Vehicle, route, vehicle_in


def taught(vehicle: Vehicle, distance: float = 1.0) -> m.Route:
    """Teach a straight route."""
    vehicle.patrol.begin("yard", "home", 0.0, vehicle.now_ns)
    for _ in range(round(distance / 0.02)):
        vehicle.at = vehicle.at.moved(0.02, 0.0)
        vehicle.step()
    return vehicle.patrol.taught()


def test_a_route_is_taught_marked_and_ended() -> None:
    vehicle = Vehicle()
    vehicle.step()
    made = taught(vehicle)
    assert [each.name for each in vehicle.patrol.station("gate", 2.0, vehicle.now_ns)] == [
        "teach.station"
    ]
    teaching = vehicle.message.teaching
    assert teaching
    assert (teaching.route, teaching.points, teaching.stations) == ("yard", 2, ("home", "gate"))
    assert teaching.length == pytest.approx(1.0, abs=0.05)
    assert vehicle.message.actions == ()
    open_teaching = vehicle.patrol.open_teaching
    assert open_teaching
    assert [each.station for each in open_teaching.points] == ["home", "gate"]
    assert [each.name for each in vehicle.patrol.end(made)] == ["teach.ended", "teach.open"]
    assert vehicle.patrol.open_teaching is None
    assert stations(made) == ("home",)
    assert length(made) == pytest.approx(1.0, abs=0.05)


def test_why_nothing_more_is_recorded_is_an_event() -> None:
    vehicle = Vehicle()
    vehicle.step()
    taught(vehicle)
    vehicle.map_state = "lost"
    vehicle.run(1.0)
    assert vehicle.events == ["teaching", "teaching"]
    assert vehicle.message.teaching
    assert [each.name for each in vehicle.message.teaching.phrases] == [
        "teach.lost", "teach.ends_here",
    ]  # fmt: skip


def test_what_is_not_possible_is_refused() -> None:
    vehicle = Vehicle()
    with pytest.raises(Refused, match="lost"):
        vehicle.patrol.begin("yard", "home", 0.0, vehicle.now_ns)  # before the first pose
    vehicle.step()
    with pytest.raises(Refused, match="none"):
        vehicle.patrol.cancel()
    vehicle.patrol.begin("yard", "home", 0.0, vehicle.now_ns)
    with pytest.raises(Refused, match="teaching"):
        vehicle.patrol.begin("other", "home", 0.0, vehicle.now_ns)
    assert vehicle.start() == "patrol.teaching"
    assert [each.name for each in vehicle.patrol.cancel()] == ["teach.cancelled"]
    assert vehicle.start() is None
    with pytest.raises(Refused, match="busy"):
        vehicle.patrol.begin("other", "home", 0.0, vehicle.now_ns)
    assert vehicle.patrol.change_refusal("yard") == Phrase("teach.driven", {"route": "yard"})
    assert vehicle.patrol.change_refusal("other") is None
    vehicle.act("abort")
    assert vehicle.patrol.change_refusal("yard") is None
    vehicle.map_state = "lost"
    vehicle.step()
    with pytest.raises(Refused, match="lost"):
        vehicle.patrol.begin("other", "home", 0.0, vehicle.now_ns)
    vehicle.map_state = "placed"
    vehicle.step()
    assert vehicle.patrol.begin("other", "home", 0.0, vehicle.now_ns)  # the round is over


def test_a_station_is_not_marked_by_an_old_pose() -> None:
    vehicle = Vehicle()
    vehicle.step()
    taught(vehicle)
    vehicle.silent.add("localization")
    vehicle.run(1.0)
    with pytest.raises(Refused, match="lost"):
        vehicle.patrol.station("gate", 0.0, vehicle.now_ns)


def test_a_round_that_cannot_be_written_is_forgotten() -> None:
    vehicle = Vehicle()
    assert vehicle.start() is None
    vehicle.patrol.forget()
    vehicle.run(3.0)
    assert (vehicle.state, vehicle.moves, vehicle.events) == ("idle", False, [])


def test_what_was_taught_before_a_restart_can_be_ended() -> None:
    vehicle = Vehicle()
    vehicle.patrol.restore_teaching(OpenTeaching("yard", route(LINE).points))
    vehicle.run(0.5)
    assert vehicle.events == ["teaching"]
    assert vehicle.patrol.taught() == route(LINE, speed=SPEED)


def reason_of(call: Callable[[], object]) -> Phrase:
    """Return why a step of teaching is refused."""
    with pytest.raises(Refused) as refused:
        call()
    return refused.value.reason


def test_the_record_of_a_round_says_what_was_started() -> None:
    vehicle = Vehicle()
    vehicle.step()
    patrol, now_ns = vehicle.patrol, vehicle.now_ns
    assert patrol.start(route(), "7-yard", "night", now_ns, vehicle.wall_ns) is None
    assert patrol.course
    assert patrol.course.diary.record == m.Round(
        id="7-yard", route="yard", robot="001", schedule="night", start_ns=vehicle.wall_ns
    )


def test_the_state_of_a_round() -> None:
    vehicle = vehicle_in("driving")
    vehicle.push(y=0.1)
    vehicle.step()
    message = vehicle.message
    assert (message.state, message.round, message.route) == ("driving", "one", "yard")
    assert (message.station, message.homeward, message.left) == ("gate", False, None)
    assert (message.length, message.corridor, message.sigma) == (4.0, 0.5, 0.05)
    assert message.progress == pytest.approx(vehicle.at.x, abs=0.05)
    assert message.deviation == pytest.approx(0.1, abs=0.02)
    assert message.text == "Driving yard; the next station is gate."
    vehicle.act("return")
    assert vehicle.message.homeward
    assert vehicle.message.progress == pytest.approx(vehicle.at.x, abs=0.05)


def test_a_patience_that_is_over_has_no_time_left() -> None:
    vehicle = vehicle_in("waiting")
    vehicle.run(PATIENCE_S + 1.0)
    assert (vehicle.state, vehicle.message.left) == ("waiting", 0.0)
    vehicle.act("pause")
    assert vehicle.message.left is None


def test_without_a_round_there_is_only_a_start() -> None:
    message = Vehicle().message
    idle = Phrase("patrol.idle")
    assert message == m.PatrolState(
        state="idle", text="No round is driven.", phrases=(idle,), actions=("start",)
    )


def test_why_a_call_is_refused() -> None:
    vehicle = Vehicle()
    vehicle.step()
    patrol, now_ns, wall_ns = vehicle.patrol, vehicle.now_ns, vehicle.wall_ns
    other: dict[str, m.Field] = {"route": "yard", "other": "002", "robot": "001"}
    idle: dict[str, m.Field] = {"action": "pause", "state": "idle", "actions": ("start",)}
    assert patrol.act("pause", now_ns, wall_ns) == Phrase("patrol.not_now", idle)
    assert patrol.start(route(robot="002"), "one", "", now_ns, wall_ns) == Phrase(
        "patrol.other_robot", other
    )
    vehicle.start()
    announcing: dict[str, m.Field] = {
        "action": "resume", "state": "announcing", "actions": ("pause", "abort")
    }  # fmt: skip
    assert patrol.act("resume", now_ns, wall_ns) == Phrase("patrol.not_now", announcing)
    busy = Phrase("patrol.busy", {"route": "yard"})
    assert patrol.start(route(name="hall"), "two", "", now_ns, wall_ns) == busy
    assert reason_of(lambda: patrol.begin("hall", "home", 0.0, now_ns)) == busy


@pytest.mark.parametrize("action", ["resume", "return"])
def test_a_vehicle_that_stands_is_announced_before_it_moves(action: m.RoundAction) -> None:
    vehicle = vehicle_in("paused")
    vehicle.push(x=1.0, y=3.0)
    assert vehicle.act(action) == "patrol.outside"
    vehicle.push(y=-3.0)
    assert vehicle.act(action) is None
    vehicle.step()
    assert (vehicle.state, vehicle.events[-1]) == ("announcing", "round_resumed")
    assert vehicle.message.progress == pytest.approx(vehicle.at.x, abs=0.05)


def test_a_round_that_is_taken_up_is_an_event() -> None:
    vehicle = vehicle_in("driving")
    after = Vehicle()
    assert vehicle.patrol.course
    after.patrol.restore(vehicle.patrol.course.open, route(), after.wall_ns)
    phrases = Phrase("patrol.restarted"), Phrase("patrol.resume")
    assert after.patrol.notes == [Note("round_stopped", "warning", phrases)]


def test_why_a_step_of_teaching_is_refused() -> None:
    vehicle = Vehicle()
    vehicle.step()
    patrol, now_ns = vehicle.patrol, vehicle.now_ns
    late_ns = now_ns + round(FRESH_S * NS_PER_S)
    lost, none = Phrase("teach.lost"), Phrase("teach.none")
    assert reason_of(lambda: patrol.begin("hall", "home", 0.0, late_ns + 1)) == lost
    assert [reason_of(each) for each in (patrol.taught, patrol.cancel)] == [none, none]
    assert reason_of(lambda: patrol.station("gate", 0.0, now_ns)) == none
    patrol.begin("hall", "home", 0.0, late_ns)
    teaching = Phrase("patrol.teaching", {"route": "hall"})
    assert reason_of(lambda: patrol.begin("yard", "home", 0.0, now_ns)) == teaching
    assert patrol.start(route(), "one", "", now_ns, vehicle.wall_ns) == teaching
    vehicle.map_state = "lost"
    vehicle.step()
    assert reason_of(lambda: patrol.station("gate", 0.0, vehicle.now_ns)) == lost


def test_the_steps_of_teaching_are_answered_and_their_begin_and_end_are_events() -> None:
    vehicle = Vehicle()
    vehicle.step()
    patrol = vehicle.patrol
    begun = patrol.begin("yard", "home", 5.0, vehicle.now_ns)
    vehicle.at = Pose(0.25, 0.0, 0.0)
    vehicle.step()
    marked = patrol.station("gate", 2.0, vehicle.now_ns)
    vehicle.at = Pose(0.5, 0.0, 0.0)
    vehicle.step()
    made = patrol.taught()
    assert made == m.Route(
        name="yard",
        robot="001",
        speed=0.5,
        corridor=0.5,
        points=(
            m.RoutePoint(x=0.0, y=0.0, station="home", stay=5.0),
            m.RoutePoint(x=0.25, y=0.0, station="gate", stay=2.0),
            m.RoutePoint(x=0.5, y=0.0),
        ),
    )
    ended = patrol.end(made)
    assert begun == (Phrase("teach.begun", {"route": "yard"}),)
    assert marked == (Phrase("teach.station", {"station": "gate", "length": 0.25}),)
    assert ended == (
        Phrase("teach.ended", {"route": "yard", "length": 0.5, "count": 2}),
        Phrase("teach.open", {"distance": 0.5, "closing": 0.5}),
    )
    vehicle.step()
    assert vehicle.notes == [Note("teaching", "info", begun), Note("teaching", "info", ended)]
    assert vehicle.message.teaching is None


@pytest.mark.parametrize(("gap", "end"), [(0.1, "teach.loop"), (0.11, "teach.open")])
def test_the_end_of_teaching_says_whether_the_route_is_a_loop(gap: float, end: str) -> None:
    answer = Vehicle().patrol.end(route(((0.0, 0.0, "home"), (4.0, 0.0), (gap, 0.0))))
    assert answer[1].name == end
    assert (answer[1].fields == {}) == (end == "teach.loop")


def test_a_cancelled_route_is_an_event() -> None:
    vehicle = Vehicle()
    vehicle.step()
    vehicle.patrol.begin("yard", "home", 0.0, vehicle.now_ns)
    cancelled = vehicle.patrol.cancel()
    assert cancelled == (Phrase("teach.cancelled", {"route": "yard"}),)
    assert vehicle.patrol.notes[-1] == Note("teaching", "info", cancelled)


def test_what_ends_a_recording_is_told_once_and_shown_from_then_on() -> None:
    vehicle = Vehicle()
    vehicle.step()
    taught(vehicle)
    vehicle.map_state = "lost"
    vehicle.run(1.0)
    teaching = vehicle.message.teaching
    assert teaching
    assert vehicle.notes[1:] == [Note("teaching", "warning", teaching.phrases)]
    assert teaching.text == render(teaching.phrases)
    restored = Vehicle()
    restored.patrol.restore_teaching(OpenTeaching("yard", route().points))
    assert restored.message.teaching
    phrases = restored.message.teaching.phrases
    assert restored.patrol.notes == [Note("teaching", "warning", phrases)]
