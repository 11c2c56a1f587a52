"""What a running bridge is asked, and what it answers: switches and lamps."""

import threading
from typing import Any

from common import keys
from common import messages as m
from tests.bridge.rig import Rig
from tests.support import wait_until


def ask(rig: Rig, call: Any, request: Any) -> Any:
    answers: list[Any] = []
    done = threading.Event()

    def take(answer: Any) -> None:
        answers.append(answer)
        done.set()

    rig.bus.ask(call, request, take, take)
    assert done.wait(10)
    return answers[0]


def test_switches_and_lamps_answer_with_the_boards_own_echo(rig: Rig) -> None:
    wait_until(lambda: (link := rig.link()) and link.state == "up", "link up")
    answer = ask(rig, keys.SET_SWITCHES, m.SwitchesRequest(bumper_brake=False))
    assert answer.bumper_brake is False
    rig.command("stop")
    wait_until(lambda: (link := rig.link()) and "brakes" in link.waiting, "not ready")
    assert ask(rig, keys.SET_SWITCHES, m.SwitchesRequest(bumper_brake=True)).bumper_brake is True
    lamp = m.LedRequest(channel=3, mode=1)
    assert isinstance(ask(rig, keys.SET_LED, lamp), m.Done)
    assert rig.board.leds[0].channel == 3


def test_refusals_name_the_reason(rig: Rig) -> None:
    wait_until(lambda: (link := rig.link()) and link.state == "up", "link up")
    lamp = m.LedRequest(channel=3, mode=1)
    rig.board.led_done = False
    assert "0xAA" in ask(rig, keys.SET_LED, lamp)
    rig.board.led_done = None
    assert "did not echo" in ask(rig, keys.SET_LED, lamp)
    rig.board.echo = False
    request = m.SwitchesRequest(ultrasonic_brake=False)
    assert "did not echo" in ask(rig, keys.SET_SWITCHES, request)
    rig.board.silent = True
    wait_until(lambda: (link := rig.link()) and link.state == "lost", "link lost")
    assert "absent" in ask(rig, keys.SET_LED, lamp)
