"""Rounds on real processes: what a killed or suspended service leaves."""

import contextlib
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import t2
from cli.settings import Everything
from common.child_process import command
from t2 import messages as m
from tests.patrol.core.vehicle_fixture import route
from tests.sdk.library_robot import blocked
from verification.harness.bus import set_options
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import becomes_true, wait_until

SETS = (
    "safety.sources.patrol={priority=5, lease=0.5}",
    'safety.limits.person={lease=1.0, silence="ignore"}',
    "localization.sources.sim={sigma=0.03, places=true}",
    "sim.fix_source=sim",
    "sim.fix_rate=5",
    "patrol.announce=0.5",
)
THERE = ((0.0, 0.0, "home"), (1.0, 0.0, "gate"), (2.0, 0.0, "end"))


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningStack]:
    folder = tmp_path_factory.mktemp("patrol")

    def beside(config: Everything) -> dict[str, list[str]]:
        endpoint, robot = config.bus.listen[0], config.robot.id
        sets = (*SETS, f"bus.listen=['{endpoint}']", f"robot.id={robot}", f"patrol.folder={folder}")
        services = ("localization", "patrol")
        return {name: command(f"services.{name}", *set_options(*sets)) for name in services}

    with running_stack(folder, sets=SETS, beside=beside) as it:
        yield it


@pytest.fixture
def robot(stack: RunningStack) -> Iterator[t2.Robot]:
    """A robot at home of a route, as each test leaves it."""
    with t2.connect("001", endpoint=stack.endpoint) as it:
        wait_until(lambda: it.localization.latest(20.0).state == "placed", "a placed vehicle", 20.0)
        wait_until(lambda: not blocked(it), "a vehicle that may drive", 30.0)
        it.patrol.save(route(THERE, stay=4.0, speed=0.3))
        yield it
        finish(it)
        wait_until(lambda: it.safety.latest().source is None, "the end of the requests")


def finish(robot: t2.Robot) -> None:
    """Drive home."""
    state = robot.patrol.latest(10.0)
    if "return" in state.actions:
        robot.patrol.go_home()
    until(robot, "done", "idle", within=40.0)


def until(robot: t2.Robot, *states: m.RoundState, within: float = 20.0) -> None:
    wait_until(lambda: robot.patrol.latest(10.0).state in states, str(states), within)


def is_reset(robot: t2.Robot) -> bool:
    """Reset; return whether safety has granted it: shortly after a stop it is still present."""
    with contextlib.suppress(t2.Refused):
        robot.reset()
    return not robot.safety.latest().latched


def announcing(robot: t2.Robot, _: RunningStack) -> None:
    robot.patrol.start("yard")


def driving(robot: t2.Robot, stack: RunningStack) -> None:
    robot.patrol.start("yard")
    wait_until(lambda: stack.speed() > 0.15, "a moving vehicle", 20.0)


def staying(robot: t2.Robot, stack: RunningStack) -> None:
    driving(robot, stack)
    until(robot, "staying")


def waiting(robot: t2.Robot, stack: RunningStack) -> None:
    driving(robot, stack)
    robot.limit("person", linear=0.0, reason="a person", seconds=3.0)
    until(robot, "waiting")


def returning(robot: t2.Robot, stack: RunningStack) -> None:
    driving(robot, stack)
    robot.patrol.go_home()
    until(robot, "returning")


def paused(robot: t2.Robot, stack: RunningStack) -> None:
    driving(robot, stack)
    robot.patrol.pause()


OTHERS = announcing, staying, waiting, returning, paused


def stands(stack: RunningStack) -> None:
    """Wait until the vehicle stands, and see that it stays there."""
    wait_until(lambda: abs(stack.speed()) < 0.01, "a standing vehicle", 5.0)
    place = stack.control.truth().distance
    assert not becomes_true(lambda: stack.control.truth().distance > place + 0.05, 1.5)


@pytest.mark.parametrize(
    "lead",
    [driving, *(pytest.param(lead, marks=pytest.mark.campaign) for lead in OTHERS)],
)
def test_a_killed_patrol_stops_and_resumes_by_a_call(
    stack: RunningStack, robot: t2.Robot, lead: Callable[[t2.Robot, RunningStack], None]
) -> None:
    lead(robot, stack)
    before = robot.patrol.latest()
    stack.kill("patrol")
    stands(stack)
    stack.start("patrol")
    wait_until(lambda: robot.patrol.latest(10.0).boot != before.boot, "another start", 20.0)
    until(robot, "stopped")
    assert robot.patrol.latest().round == before.round
    stands(stack)
    robot.patrol.resume()
    until(robot, "driving", "staying", "returning")


@pytest.mark.campaign
def test_a_suspended_patrol_stops_the_vehicle_and_wants_a_call(
    stack: RunningStack, robot: t2.Robot
) -> None:
    driving(robot, stack)
    stack.processes["patrol"].send_signal(signal.SIGSTOP)
    stands(stack)
    time.sleep(2.0)  # longer than a pause that it drives on after
    stack.processes["patrol"].send_signal(signal.SIGCONT)
    until(robot, "stopped")
    stands(stack)


@pytest.mark.campaign
def test_a_second_patrol_service_stops_a_round(
    stack: RunningStack, robot: t2.Robot, tmp_path: Path
) -> None:
    driving(robot, stack)
    sets = set_options(f"patrol.folder={tmp_path}")
    stack.commands["second"] = [*stack.commands["patrol"], *sets]
    stack.start("second")
    stands(stack)
    with pytest.raises(t2.Refused, match="Another patrol service"):
        robot.patrol.resume()
    stack.kill("second")
    until(robot, "stopped")
    time.sleep(3.0)  # after 2 s its silence is its end
    robot.patrol.resume()
    until(robot, "driving", "staying")


@pytest.mark.parametrize(
    "number", [signal.SIGKILL, pytest.param(signal.SIGSTOP, marks=pytest.mark.campaign)]
)
def test_a_dead_localization_stops_a_round(
    stack: RunningStack, robot: t2.Robot, number: signal.Signals
) -> None:
    driving(robot, stack)
    before = robot.localization.latest()
    stack.processes["localization"].send_signal(number)
    until(robot, "stopped")
    stands(stack)
    if number == signal.SIGKILL:
        stack.start("localization")
        wait_until(lambda: robot.localization.latest(10.0).boot != before.boot, "another start")
    else:
        stack.processes["localization"].send_signal(signal.SIGCONT)
    wait_until(lambda: robot.localization.age < 0.5, "fresh poses")
    wait_until(lambda: robot.localization.latest(10.0).state == "placed", "a pose")
    stands(stack)
    assert robot.patrol.latest().state == "stopped"


def test_an_emergency_stop_wants_a_reset_and_a_call(stack: RunningStack, robot: t2.Robot) -> None:
    driving(robot, stack)
    robot.estop()
    until(robot, "stopped")
    with pytest.raises(t2.Refused, match="A reset is needed"):
        robot.patrol.resume()
    wait_until(lambda: is_reset(robot), "a reset")
    stands(stack)
    assert robot.patrol.latest().state == "stopped"
    robot.patrol.resume()
    until(robot, "driving", "staying")


def test_a_restart_of_the_router_stops_a_round(stack: RunningStack, robot: t2.Robot) -> None:
    driving(robot, stack)
    stack.kill("router")
    stands(stack)
    stack.start("router")
    until(robot, "stopped", within=30.0)
    wait_until(lambda: "estop_reader" in robot.safety.latest(10.0).latched, "the latch", 20.0)
    wait_until(lambda: is_reset(robot), "a reset")
    stands(stack)
    assert robot.patrol.latest(10.0).state == "stopped"
