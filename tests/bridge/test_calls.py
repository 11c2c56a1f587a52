"""Calls of a running bridge: switches and lamps."""

import threading
from typing import Any

from common import clock, keys
from common import messages as m
from common.freshness import NS_PER_S
from common.motion import Command
from tests.bridge.bridge_fixture import BridgeFixture
from verification.harness.waiting import wait_until


def switches(bridge: BridgeFixture, **brakes: bool) -> m.SwitchesRequest:
    """Return the request of an operator who sees the newest state of safety."""
    return m.SwitchesRequest(**brakes, echo=bridge.heartbeat)


def send_request(bridge: BridgeFixture, call: Any, request: Any) -> Any:
    answers: list[Any] = []
    done = threading.Event()

    def take(answer: Any) -> None:
        answers.append(answer)
        done.set()

    bridge.bus.call(call, request, take, take)
    assert done.wait(10)
    return answers[0]


def ready(bridge: BridgeFixture) -> None:
    """Wait until the bridge has its board and receives safety's state."""
    wait_until(lambda: (link := bridge.link()) and link.state == "up", "link up")
    wait_until(
        lambda: isinstance(send_request(bridge, keys.SET_SWITCHES, switches(bridge)), m.Switches),
        "a call that is in time",
    )


def test_switches_and_lamps_answer_with_the_boards_own_echo(bridge: BridgeFixture) -> None:
    ready(bridge)
    answer = send_request(bridge, keys.SET_SWITCHES, switches(bridge, bumper_brake=False))
    assert answer.bumper_brake is False
    bridge.command(Command.STOP)
    wait_until(lambda: (link := bridge.link()) and "brakes" in link.waiting, "not ready")
    assert (
        send_request(bridge, keys.SET_SWITCHES, switches(bridge, bumper_brake=True)).bumper_brake
        is True
    )
    lamp = m.LedRequest(channel=3, mode=1)
    assert isinstance(send_request(bridge, keys.SET_LED, lamp), m.Done)
    assert bridge.board.leds[0].channel == 3


def test_refusals_name_the_reason(bridge: BridgeFixture) -> None:
    ready(bridge)
    lamp = m.LedRequest(channel=3, mode=1)
    bridge.board.led_done = False
    assert "0xAA" in send_request(bridge, keys.SET_LED, lamp)
    bridge.board.led_done = None
    assert "did not echo" in send_request(bridge, keys.SET_LED, lamp)
    bridge.board.echo = False
    request = switches(bridge, ultrasonic_brake=False)
    assert "did not echo" in send_request(bridge, keys.SET_SWITCHES, request)
    bridge.board.silent = True
    wait_until(lambda: (link := bridge.link()) and link.state == "lost", "link lost")
    assert "absent" in send_request(bridge, keys.SET_LED, lamp)


def test_switches_that_were_asked_late_are_refused(bridge: BridgeFixture) -> None:
    ready(bridge)
    late = switches(bridge, bumper_brake=False)
    due_ns = clock.now_ns() + round(1.1 * NS_PER_S)
    wait_until(lambda: clock.now_ns() > due_ns, "a late call")
    assert "allowed is 1 s" in send_request(bridge, keys.SET_SWITCHES, late)
    assert "no echo" in send_request(
        bridge, keys.SET_SWITCHES, m.SwitchesRequest(bumper_brake=False)
    )
    unknown = m.SwitchesRequest(bumper_brake=False, echo=1)
    assert "unknown heartbeat" in send_request(bridge, keys.SET_SWITCHES, unknown)
    assert send_request(bridge, keys.SET_SWITCHES, switches(bridge)).bumper_brake is True
