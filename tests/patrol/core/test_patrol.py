"""Who may ask for what, and when: rounds and routes together."""

import pytest

from services.patrol.core.diary import MOST, Diary
from services.patrol.core.routes import length, stations
from services.patrol.core.teaching import OpenTeaching, Refused
from services.patrol.core.track import Fit, Nearest
from t2 import messages as m
from t2.messages import MAX_TRACK, Phrase
from tests.patrol.core.vehicle_fixture import LINE, Vehicle, route


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
    assert vehicle.patrol.taught().points == route(LINE).points


FIT = Fit(Nearest(0.0, 0.1, 0.0), 0.05, 0.5)


def diary() -> Diary:
    return Diary(m.Round(id="1", route="yard", robot="001", start_ns=0))


def test_the_track_of_a_long_round_is_thinned() -> None:
    made = diary()
    for step in range(12_000):
        made.on_pose(step * 0.1, 0.0, FIT)
    assert MAX_TRACK / 2 < len(made.track) <= MAX_TRACK
    assert made.track[0].x == 0.0
    assert made.track[-1].x == pytest.approx(1200.0, abs=2.0)
    assert made.record.distance == pytest.approx(1199.9)


def test_a_correction_is_not_driven() -> None:
    made = diary()
    for x in (0.0, 0.1, 5.0, 5.1):
        made.on_pose(x, 0.0, FIT)
    assert made.record.distance == pytest.approx(0.2)
    assert made.record.margin == pytest.approx(0.3)


def test_lists_of_a_round_that_never_ends_are_bounded() -> None:
    made = diary()
    for number in range(MOST + 50):
        made.visit("gate", number)
        made.halt("waiting", (), (0.0, 0.0), number)
        made.go_on(number - 10)  # the clock was set backward
        made.file("x.mcap")
    record = made.record
    assert (len(record.visits), len(record.halts)) == (MOST, MOST)
    assert len(record.recordings) == 20
    assert {each.seconds for each in record.halts} == {0.0}
