"""What a round tells: its events, the reasons of its states, and those of a refusal."""

from typing import Any

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.pose import Pose
from services.patrol.core.course import FROZEN_M, TICK_S, Note
from t2 import messages as m
from t2.messages import Phrase
from tests.patrol.core.vehicle_fixture import (
    ANNOUNCE_S,
    LINE,
    LOOP,
    PATIENCE_S,
    TICK_NS,
    Vehicle,
    route,
    vehicle_in,
)

LATE_S = PATIENCE_S + TICK_S  # the first tick after the patience
RESUME = Phrase("patrol.resume")
BLOCKED = Phrase("blocked")  # safety's
ANNOUNCING = Phrase("patrol.announcing", {"route": "yard"})
RETURNING = Phrase("patrol.returning", {"route": "yard"})
SWITCHED_OFF = Phrase("patrol.forbidden", {"causes": ("switches",)})
LATCHED = Phrase("patrol.latched", {"causes": ("estop",)})


def about(number: float) -> Any:
    return pytest.approx(number, abs=0.02)


def record_of(vehicle: Vehicle) -> m.Round:
    assert vehicle.patrol.course
    return vehicle.patrol.course.diary.record


@pytest.mark.parametrize(
    ("state", "station", "phrases"),
    [
        ("announcing", "gate", (ANNOUNCING,)),
        ("driving", "gate", (Phrase("patrol.driving", {"route": "yard", "station": "gate"}),)),
        ("staying", "gate", (Phrase("patrol.staying", {"station": "gate"}),)),
        ("waiting", "gate", (Phrase("patrol.waiting"), BLOCKED)),
        ("returning", "home", (Phrase("patrol.returning", {"route": "yard", "station": "home"}),)),
        ("paused", "gate", (Phrase("patrol.paused"),)),
        ("stopped", "gate", (LATCHED, RESUME)),
        ("done", "", (Phrase("patrol.aborted"),)),
    ],
)
def test_each_state_has_a_station_and_a_reason(
    state: m.RoundState, station: str, phrases: m.Phrases
) -> None:
    message = vehicle_in(state).message
    assert (message.station, message.phrases) == (station, phrases)


def test_the_events_of_a_round() -> None:
    vehicle = Vehicle()
    assert vehicle.start(route(LOOP)) is None
    vehicle.until("done")
    assert vehicle.notes == [
        Note("round_start", "info", (ANNOUNCING,)),
        Note("station", "info", (Phrase("patrol.station", {"station": "gate"}),)),
        Note("round_end", "info", (Phrase("patrol.home"),)),
    ]
    assert record_of(vehicle).visits[-1] == m.Visit(station="home", t_ns=vehicle.wall_ns)


@pytest.mark.parametrize(
    ("state", "action", "event"),
    [
        ("driving", "pause", Note("round_paused", "info", (Phrase("patrol.paused"),))),
        ("driving", "return", Note("round_return", "info", (RETURNING,))),
        ("driving", "abort", Note("round_end", "warning", (Phrase("patrol.aborted"),))),
        ("paused", "resume", Note("round_resumed", "info", (ANNOUNCING,))),
    ],
)  # fmt: skip
def test_a_call_is_an_event(state: m.RoundState, action: m.RoundAction, event: Note) -> None:
    vehicle = vehicle_in(state)
    assert vehicle.act(action) is None
    vehicle.step()
    assert vehicle.notes[-1] == event


def test_another_source_is_an_event() -> None:
    vehicle = vehicle_in("driving")
    vehicle.source = "teleop"
    vehicle.run(1.0)
    phrases = (Phrase("patrol.overruled", {"source": "teleop"}),)
    assert vehicle.notes[-1] == Note("round_paused", "info", phrases)


def test_a_stop_by_an_obstacle_is_an_event_and_so_is_the_end_of_the_patience() -> None:
    vehicle = vehicle_in("driving")
    vehicle.causes = ("blocked",)
    vehicle.run(PATIENCE_S + 1.0)
    late = Phrase("patrol.blocked", {"seconds": LATE_S})
    assert vehicle.notes[1:] == [
        Note("round_waiting", "info", (Phrase("patrol.waiting"), BLOCKED)),
        Note("round_blocked", "warning", (late, BLOCKED)),
    ]


def test_an_obstacle_at_the_begin_is_told_too() -> None:
    vehicle = vehicle_in("announcing")
    vehicle.causes = ("blocked",)
    vehicle.run(ANNOUNCE_S + PATIENCE_S + 1.0)
    assert vehicle.events == ["round_start", "round_waiting", "round_blocked"]


def test_each_time_that_it_is_blocked_is_an_event() -> None:
    vehicle = vehicle_in("driving")
    for _ in range(2):
        vehicle.causes = ("blocked",)
        vehicle.run(PATIENCE_S + 1.0)
        vehicle.causes = ()
        vehicle.run(2.5)
    assert vehicle.events == ["round_start", *["round_waiting", "round_blocked"] * 2]


STOPS: dict[str, tuple[Any, Phrase]] = {
    "latched": (lambda it: setattr(it, "latched", ("estop",)), LATCHED),
    "held up": (
        lambda it: setattr(it, "now_ns", it.now_ns + 4 * NS_PER_S - TICK_NS),
        Phrase("patrol.held_up", {"seconds": 4.0}),
    ),
    "outside": (
        lambda it: it.push(y=0.75),
        Phrase("patrol.outside", {"deviation": about(0.75), "corridor": 0.5}),
    ),
    "uncertain": (
        lambda it: setattr(it, "sigma", 0.5),
        Phrase(
            "patrol.uncertain",
            {"deviation": about(0.0), "sigma": 0.5, "corridor": 0.5},
        ),
    ),
}


@pytest.mark.parametrize("stop", STOPS)
def test_a_stop_is_an_event_and_says_why(stop: str) -> None:
    vehicle = vehicle_in("driving")
    cause, reason = STOPS[stop]
    cause(vehicle)
    vehicle.step()
    assert vehicle.notes[-1] == Note("round_stopped", "warning", (reason, RESUME))
    assert vehicle.message.phrases == (reason, RESUME)


def test_the_first_of_two_causes_between_two_ticks_is_named() -> None:
    vehicle = vehicle_in("driving")
    for latched in (("estop",), ("switches",)):
        vehicle.patrol.on_safety(replace(vehicle._state(), latched=latched), vehicle.now_ns)
    vehicle.patrol.on_pose(replace(vehicle._pose(), state="lost"), vehicle.now_ns)
    vehicle.step()
    assert vehicle.message.phrases == (LATCHED, RESUME)


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"latched": ("estop",)}, LATCHED),
        ({"map_state": "lost"}, Phrase("map.uncertain", {"sigma": 0.2, "degrees": 3.0})),
        ({"source": "teleop"}, Phrase("patrol.other_drives", {"source": "teleop"})),
        ({"causes": ("blocked", "switches")}, SWITCHED_OFF),
        (
            {"at": Pose(2.0, 0.0, 0.0)},
            Phrase("patrol.not_home", {"distance": 2.0, "route": "yard", "corridor": 0.5}),
        ),
        (
            {"at": Pose(0.25, 0.0, 0.0), "sigma": 0.25},
            Phrase("patrol.uncertain", {"deviation": 0.25, "sigma": 0.25, "corridor": 0.5}),
        ),
    ],
)  # fmt: skip
def test_a_refused_start_says_why(fields: dict[str, Any], reason: Phrase) -> None:
    vehicle = Vehicle()
    for name, value in fields.items():
        setattr(vehicle, name, value)
    vehicle.step()
    patrol, now_ns = vehicle.patrol, vehicle.now_ns
    assert patrol.start(route(), "one", "", now_ns, vehicle.wall_ns) == reason


def test_a_vehicle_that_does_not_get_on_is_stuck() -> None:
    vehicle = vehicle_in("driving")
    place = vehicle.at
    for step in range(round((PATIENCE_S + 1) / TICK_S)):
        vehicle.at = Pose(place.x, place.y + 0.15 * (step % 2), place.heading)  # it swings
        vehicle.step()
    assert vehicle.message.phrases == (Phrase("patrol.stuck", {"seconds": LATE_S}), RESUME)
    assert len(record_of(vehicle).halts) == 0  # it is not over
    vehicle.act("abort")
    (halt,) = record_of(vehicle).halts
    assert halt.t_ns + round(halt.seconds * NS_PER_S) == vehicle.wall_ns


@pytest.mark.parametrize("waited", [False, True])
def test_a_frozen_position_says_how_far_it_drove(waited: bool) -> None:
    vehicle = vehicle_in("waiting" if waited else "driving")
    vehicle.causes = ()
    vehicle.until("driving")
    place = vehicle.at
    while vehicle.state == "driving":
        vehicle.at = place
        vehicle.step()
    assert vehicle.message.phrases == (Phrase("patrol.frozen", {"distance": FROZEN_M}), RESUME)
    assert vehicle.act("abort") is None
    assert record_of(vehicle).halts[-1].state == "stopped"


def test_a_route_may_say_to_stop_after_the_patience() -> None:
    vehicle = Vehicle().driving(route(blocked="stop"))
    vehicle.causes = ("blocked",)
    vehicle.until("stopped")
    assert vehicle.message.phrases == (Phrase("patrol.blocked_stop", {"seconds": LATE_S}), RESUME)


@pytest.mark.parametrize(
    ("action", "result"), [("abort", "aborted"), ("return", "returned"), ("depart", "home")]
)
def test_the_record_says_how_a_round_ended(action: m.RoundAction, result: m.RoundResult) -> None:
    vehicle = vehicle_in("staying")
    assert vehicle.act(action) is None
    vehicle.until("done")
    record = record_of(vehicle)
    assert (record.result, record.phrases) == (result, (Phrase(f"patrol.{result}"),))
    assert (record.end_ns, record.text) == (vehicle.wall_ns, vehicle.message.text)


def test_visits_and_halts_have_their_time() -> None:
    vehicle = Vehicle()
    assert vehicle.start(route(stay=1.0)) is None
    vehicle.until("staying")
    visit = m.Visit(station="gate", t_ns=vehicle.wall_ns)
    assert vehicle.act("pause") is None
    paused_ns = vehicle.wall_ns
    vehicle.run(2.0)
    assert vehicle.act("resume") is None
    vehicle.until("done")
    record = record_of(vehicle)
    assert record.visits == (visit, m.Visit(station="home", t_ns=vehicle.wall_ns))
    (halt,) = record.halts
    assert (halt.state, halt.t_ns, halt.seconds) == ("paused", paused_ns, 2.0 + TICK_S)
    assert halt.phrases == (Phrase("patrol.paused"),)


@pytest.mark.parametrize("points", [LOOP, LINE])
def test_a_stay_that_is_reached_while_waiting_ends_the_waiting(points: Any) -> None:
    vehicle = Vehicle().driving(route(points, stay=2.0), until_x=3.0)
    vehicle.causes = ("limit_stop",)
    vehicle.until("waiting")
    vehicle.push(x=4.0 - vehicle.at.x)
    vehicle.step()
    assert vehicle.state == "staying"
    assert [(each.state, each.seconds) for each in record_of(vehicle).halts] == [
        ("waiting", TICK_S)
    ]
