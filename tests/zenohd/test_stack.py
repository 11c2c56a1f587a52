"""The stack on zenohd behaves as on its own router."""

import json

import pytest

from common import keys
from common.bus.bus import Bus
from common.bus.probe import probe
from common.loop import Loop
from common.messages import Event, ResetRequest
from tests.cli.processes import ran, sets
from tests.drive_source import ConstantSource, drive_until_moving, moves_since
from verification.harness.bus import bus_on, running
from verification.harness.stack import RunningStack
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed


def t2(stack: RunningStack, *words: str) -> tuple[int, str]:
    """Run a t2 command on the stack; return its exit code and output."""
    done = ran(*words, *sets(f"bus.connect={stack.endpoint}"))
    return done.returncode, done.stdout + done.stderr


def reset(stack: RunningStack) -> None:
    """Retry the reset until it succeeds."""
    wait_until(lambda: t2(stack, "call", "safety/reset")[0] == 0, "a reset")


def test_it_drives_and_an_emergency_stop_stops_it(
    stack: RunningStack, source: ConstantSource
) -> None:
    drive_until_moving(stack, source)
    code, said = t2(stack, "estop")
    assert code == 0, said
    wait_until(lambda: stack.last() == "brake", "BRAKE at the board")
    wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")
    assert not moves_since(stack, len(stack.trace().commands))
    source.linear = 0.0
    reset(stack)
    drive_until_moving(stack, source)


def test_the_routers_death_stops_it_and_the_next_one_takes_over(
    stack: RunningStack, source: ConstantSource
) -> None:
    drive_until_moving(stack, source)
    stack.kill("router")
    wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")
    assert stack.last() in ("stop", "brake")
    count = len(stack.trace().commands)
    stack.start("router")
    wait_until(lambda: t2(stack, "services")[0] == 0, "the services on the next router")
    assert not moves_since(stack, count)
    source.linear = 0.0
    reset(stack)
    drive_until_moving(stack, source)


def test_services_are_listed_by_tokens_and_admin_space(stack: RunningStack) -> None:
    code, output = t2(stack, "services", "--json")
    assert code == 0, output
    services = {row["name"]: row for row in map(json.loads, output.splitlines()) if row["service"]}
    assert {"bridge", "safety", "odom"} <= set(services)
    assert "tel/odom/odometry" in services["odom"]["publishes"]
    assert "tel/bridge/bumper" in services["safety"]["reads"]
    assert "srv/safety/reset" in services["safety"]["answers"]


def test_the_doctor_reaches_the_robot(stack: RunningStack) -> None:
    """The robot's own health is not checked: a stall or a latch is possible."""
    _, output = t2(stack, "doctor", "--json")
    found = [json.loads(line) for line in output.splitlines()]
    well = {"network": {"ok"}, "router": {"ok"}, "services": {"ok", "note"}, "rights": {"ok"}}
    for where, levels in well.items():
        seen = {one["level"] for one in found if one["where"] == where}
        assert seen, where
        assert seen <= levels, output
    router = next(one for one in found if one["where"] == "router")
    assert "as on this laptop" in router["text"]


def test_a_killed_service_loses_its_token(stack: RunningStack) -> None:
    token = keys.live_key("001", "odom", "*")
    with probe(stack.config.bus) as opened:
        assert len(opened.alive(token)) == 1
        stack.kill("odom")
        wait_until(lambda: not opened.alive(token), "the end of the token")
        stack.start("odom")
        wait_until(lambda: len(opened.alive(token)) == 1, "the next token")


def test_a_late_subscriber_receives_earlier_events(stack: RunningStack) -> None:
    received: list[Event] = []
    refusals: list[str] = []

    def declare(bus: Bus) -> None:
        bus.subscribe(keys.EVENTS, lambda a: received.append(a.message), depth=99, service="*")

    with running(Loop()) as loop, bus_on(stack.endpoint, loop, declare) as bus:
        wait_until(
            lambda: "link_up" in [each.name for each in received], "the bridge's first event"
        )
        bus.call(keys.RESET, ResetRequest(), print, refusals.append)  # names no latch
        wait_until(lambda: refusals, "a reply")
        wait_until(lambda: "reset_refused" in [each.name for each in received], "a new event")
