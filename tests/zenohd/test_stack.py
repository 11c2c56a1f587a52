"""What the stack does on its own router it does on zenohd."""

import json

import pytest

from common import keys
from common.bus.bus import Bus
from common.bus.probe import probe
from common.loop import Loop
from common.messages import Event, ResetRequest
from tests.cli.processes import ran, sets
from tests.drive_source import Stick, moves_since, push
from verification.harness.stack import Chain
from verification.harness.support import bus_on, running, wait_until

pytestmark = pytest.mark.alone


def t2(stack: Chain, *words: str) -> tuple[int, str]:
    """Run the command on that stack; return its exit code and what it said."""
    done = ran(*words, *sets(f"bus.connect={stack.endpoint}"))
    return done.returncode, done.stdout + done.stderr


def reset(stack: Chain) -> None:
    """Clear what is latched, as an operator does who keeps asking."""
    wait_until(lambda: t2(stack, "call", "safety/reset")[0] == 0, "a reset")


def test_it_drives_and_an_emergency_stop_stops_it(stack: Chain, stick: Stick) -> None:
    push(stack, stick)
    code, said = t2(stack, "estop")
    assert code == 0, said
    wait_until(lambda: stack.last() == "brake", "BREAK at the board")
    wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")
    assert not moves_since(stack, len(stack.trace().commands))
    stick.linear = 0.0
    reset(stack)
    push(stack, stick)


def test_the_routers_death_stops_it_and_the_next_one_takes_over(stack: Chain, stick: Stick) -> None:
    push(stack, stick)
    stack.kill("router")
    wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")
    assert stack.last() in ("stop", "brake")
    count = len(stack.trace().commands)
    stack.start("router")
    wait_until(lambda: t2(stack, "services")[0] == 0, "the services on the next router")
    assert not moves_since(stack, count)
    stick.linear = 0.0
    reset(stack)
    push(stack, stick)


def test_who_is_there_is_told_by_tokens_and_by_the_admin_space(stack: Chain) -> None:
    code, said = t2(stack, "services", "--json")
    assert code == 0, said
    who = {row["name"]: row for row in map(json.loads, said.splitlines()) if row["service"]}
    assert {"bridge", "safety", "odom"} <= set(who)
    assert "tel/odom/odometry" in who["odom"]["publishes"]
    assert "tel/bridge/bumper" in who["safety"]["reads"]
    assert "srv/safety/reset" in who["safety"]["answers"]


def test_the_doctor_gets_to_the_robot(stack: Chain) -> None:
    """How the robot fares is another matter: it may be held up, or latched."""
    _, said = t2(stack, "doctor", "--json")
    found = [json.loads(line) for line in said.splitlines()]
    well = {"network": {"ok"}, "router": {"ok"}, "services": {"ok", "note"}, "rights": {"ok"}}
    for where, levels in well.items():
        seen = {one["level"] for one in found if one["where"] == where}
        assert seen, where
        assert seen <= levels, said
    router = next(one for one in found if one["where"] == "router")
    assert "as on this laptop" in router["text"]


def test_a_killed_service_takes_its_token_along(stack: Chain) -> None:
    token = keys.live_key("001", "odom", "*")
    with probe(stack.config.bus) as opened:
        assert len(opened.alive(token)) == 1
        stack.kill("odom")
        wait_until(lambda: not opened.alive(token), "the end of the token")
        stack.start("odom")
        wait_until(lambda: len(opened.alive(token)) == 1, "the next token")


def test_who_comes_late_is_told_what_happened_before(stack: Chain) -> None:
    heard: list[Event] = []
    refusals: list[str] = []

    def declare(bus: Bus) -> None:
        bus.subscribe(keys.EVENTS, lambda a: heard.append(a.message), depth=99, service="*")

    with running(Loop()) as loop, bus_on(stack.endpoint, loop, declare) as bus:
        wait_until(lambda: "link_up" in [each.name for each in heard], "the bridge's first event")
        bus.ask(keys.RESET, ResetRequest(), print, refusals.append)  # names nothing
        wait_until(lambda: refusals, "a reply")
        wait_until(lambda: "reset_refused" in [each.name for each in heard], "a new event")
