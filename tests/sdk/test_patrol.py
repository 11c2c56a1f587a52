"""Routes and rounds by the client library on the simulated stack, in simulated time."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

import t2
from tests.simulated_robot import SimulatedStack
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.simulated


@pytest.fixture
def robot(simulated: t2.Robot) -> t2.Robot:
    """A robot at home of a taught route."""
    simulated.place(0.0, 0.0, 0.0, sigma=0.03)
    simulated.patrol.teach("院子", "大门", stay=1.0)
    with simulated.drive("nav") as drive:
        drive.forward(1.0)
        simulated.patrol.station("gate", stay=5.0)
    simulated.patrol.end()
    wait_until(lambda: simulated.safety.latest().source is None, "the end of the drive")
    simulated.place(0.0, 0.0, 0.0, sigma=0.03)
    return simulated


def test_a_route_is_read_changed_and_deleted(robot: t2.Robot) -> None:
    (summary,) = robot.patrol.routes()
    assert (summary.name, summary.stations) == ("院子", ("大门", "gate"))
    route = robot.patrol.route("院子")
    assert [each.stay for each in route.points if each.station] == [1.0, 5.0]
    robot.patrol.save(replace(route, name="copy", speed=0.3))
    assert robot.patrol.route("copy").speed == 0.3
    robot.patrol.delete("院子")
    assert [each.name for each in robot.patrol.routes()] == ["copy"]


def test_a_round_is_started_paused_resumed_and_aborted(robot: t2.Robot) -> None:
    patrol = robot.patrol
    patrol.start("院子")
    for act, state in (
        (patrol.pause, "paused"),
        (patrol.resume, "announcing"),
        (patrol.pause, "paused"),
        (patrol.go_home, "announcing"),
        (patrol.abort, "done"),
    ):
        act()
        wait_until(lambda: patrol.latest().state == state, state)  # noqa: B023 - called at once
    (found,) = patrol.rounds()
    assert (found.result, found.route) == ("aborted", "院子")
    kept = patrol.round(found.id)
    assert kept.rounds == (found,)
    assert kept.route == patrol.route("院子")


def test_teaching_that_is_cancelled_leaves_no_route(robot: t2.Robot) -> None:
    robot.patrol.teach("b", "home")
    robot.patrol.cancel()
    assert [each.name for each in robot.patrol.routes()] == ["院子"]


@pytest.mark.parametrize(
    ("act", "reason"),
    [
        (lambda it: it.start("nix"), "There is no route nix"),
        (lambda it: it.route("nix"), "There is no route nix"),
        (lambda it: it.delete("nix"), "There is no route nix"),
        (lambda it: it.round("nix"), "There is no round nix"),
        (lambda it: it.teach("院子", "home"), "exists"),
        (lambda it: it.depart(), "depart: not possible now"),
        (lambda it: it.end(), "No route is being taught"),
    ],
)
def test_refusals(act: Callable[[t2.Patrol], object], reason: str, robot: t2.Robot) -> None:
    with pytest.raises(t2.Refused, match=reason):
        act(robot.patrol)


def test_only_what_stops_works_without_safety(
    robot: t2.Robot, simulated_stack: SimulatedStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(t2.stream, "robots_of", lambda _: [])
    robot.patrol.start("院子")
    simulated_stack.processes["safety"].stall(60_000)
    simulated_stack.clock.sleep(1.5)
    for act in (robot.patrol.resume, lambda: robot.patrol.start("院子"), robot.patrol.end):
        with pytest.raises(t2.NoData, match="no safety within"):
            act()
    robot.patrol.abort()
    wait_until(lambda: robot.patrol.latest().state == "done", "the end")


def test_a_time_that_is_no_number_is_not_sent(robot: t2.Robot) -> None:
    with pytest.raises(ValueError, match="nan"):
        robot.patrol.teach("b", "home", stay=float("nan"))
    assert robot.patrol.latest().teaching is None
