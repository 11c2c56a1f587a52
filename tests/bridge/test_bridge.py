"""The bridge as a process: real UDP on one side, a real router on the other."""

import threading
import time
from typing import Any

from common import codec, keys
from common import messages as m
from common.loop import Loop
from common.motion import Command
from common.wire import reports
from common.wire.commands import MotionKind
from common.wire.framing import Framing
from tests.bridge.bridge_fixture import BridgeFixture
from verification.harness.bus import bus_on, running
from verification.harness.waiting import wait_until


def test_everything_the_board_says_reaches_the_bus_with_its_raw_frame(
    bridge: BridgeFixture,
) -> None:
    names = ["velocity", "mileage", "ultrasonic", "bumper", "driver/left", "driver/right"]
    wait_until(lambda: {f"tel/bridge/{name}" for name in names} <= set(bridge.seen), "all streams")
    wait_until(lambda: (link := bridge.link()) and link.state == "up", "link up")
    wait_until(
        lambda: (
            (s := bridge.newest("tel/bridge/switches")) and s.ultrasonic_brake and s.bumper_brake
        ),
        "both switches on and echoed",
    )
    assert bridge.newest("tel/bridge/mileage").distance == 1.0
    assert bridge.raw["tel/bridge/bumper"] == Framing().pack(reports.BumperReport(False))
    assert bridge.newest("tel/bridge/ultrasonic").ranges == (1.0,) * 8


def test_a_motion_from_the_router_is_not_even_read(bridge: BridgeFixture) -> None:
    bridge.drive()
    rejected = m.Motion(command=Command.RUN, linear=0.9, boot=bridge.bus.boot, seq=2**62)
    with running(Loop()) as loop, bus_on(bridge.endpoint, loop, lambda _: None) as foreign:
        session = foreign.sessions[0].zenoh
        assert session is not None
        for _ in range(50):
            session.put(keys.MOTION.on("001"), codec.encode(rejected))
            time.sleep(0.02)
    assert not any(motion.linear_mmps == 900 for motion in bridge.board.motions)
    assert "second_authority" not in bridge.events()
    assert bridge.board.last().kind is MotionKind.RUN  # type: ignore[union-attr]


# --- calls ----------------------------------------------------------------------------------------


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
