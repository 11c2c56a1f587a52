"""The bridge as a process: real UDP on one side, a real router on the other."""

import socket
import threading
import time
from typing import Any

import msgpack

from common import clock, codec, keys
from common import messages as m
from common.freshness import NS_PER_S
from common.loop import Loop
from common.motion import Command
from common.wire import reports
from common.wire.commands import MotionKind
from common.wire.framing import Framing
from tests.bridge.bridge_fixture import BridgeFixture, bridge_process
from verification.harness.bus import bus_on, running
from verification.harness.fake_board import board
from verification.harness.waiting import wait_until

STOPS = [MotionKind.STOP] * 10


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


def test_begins_with_stop_even_without_a_router() -> None:
    with board() as made, bridge_process(made, "tcp/127.0.0.1:1"):
        # The guard sends BRAKE until the first STOP of the bridge. The bridge sends BRAKE while it
        # receives no velocity: the test's board may stall.
        wait_until(lambda: [motion.kind for motion in made.motions[-10:]] == STOPS, "STOP at 20 Hz")
        assert {motion.kind for motion in made.motions} <= {MotionKind.BREAK, MotionKind.STOP}


def test_a_run_needs_a_neutral_first_and_silence_ends_it(bridge: BridgeFixture) -> None:
    bridge.rearms = False
    bridge.command(Command.RUN, 0.5)
    wait_until(lambda: (link := bridge.link()) and "neutral" in link.waiting, "asks for a neutral")
    bridge.rearms = True
    bridge.drive()
    bridge.silence()
    bridge.board.wait_for(MotionKind.STOP)
    bridge.rearms = False
    bridge.command(Command.RUN, 0.5)
    wait_until(lambda: (link := bridge.link()) and not link.armed, "disarmed")
    assert bridge.board.last().kind is MotionKind.STOP  # type: ignore[union-attr]


def test_the_reflex_breaks_and_only_a_judging_motion_ends_it(bridge: BridgeFixture) -> None:
    bridge.drive()
    bridge.silence()
    bridge.board.pressed = True
    bridge.board.wait_for(MotionKind.BREAK)
    wait_until(lambda: "contact" in bridge.events(), "the event")
    bridge.motion.put(m.Motion(command=Command.RUN, linear=0.3))
    wait_until(lambda: bridge.newest("tel/bridge/bumper").pressed, "the bumper message")
    bridge.command(Command.STOP)
    wait_until(lambda: (link := bridge.link()) and link.armed, "judged and neutral")
    runs = [motion for motion in bridge.board.motions if motion.linear_mmps == 300]
    assert runs == []


def test_wrong_types_and_garbage_on_motion_are_dropped(bridge: BridgeFixture) -> None:
    bridge.drive()
    session = bridge.bus.sessions[1].zenoh  # the drive link's
    assert session is not None
    for payload in (b"", b"\xc1", msgpack.packb({"command": "fly"}), msgpack.packb([1] * 1000)):
        session.put("t2/v1/001/@cmd/motion", payload)
    bridge.command(Command.STOP)
    bridge.board.wait_for(MotionKind.STOP)
    assert bridge.process.poll() is None


def test_one_dead_port_costs_no_link(bridge: BridgeFixture) -> None:
    wait_until(lambda: (link := bridge.link()) and link.state == "up", "link up")
    for port in (1, 0, 1):
        bridge.board.to_ports = [port]
        bridge.drive()
        wait_until(lambda: (link := bridge.link()) and link.state == "up", "link up")
    wait_until(lambda: "port_changed" in bridge.events(), "the event")


def test_frames_of_strangers_and_broken_frames_are_counted_not_taken(bridge: BridgeFixture) -> None:
    wait_until(lambda: (link := bridge.link()) and link.state == "up", "link up")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as foreign:
        foreign.bind(("127.0.0.1", 0))
        bridge.board.say(reports.BumperReport(True), foreign)
    good = Framing().pack(reports.BumperReport(True))
    bridge.board.say_bytes(good[:-1] + b"\0")
    bridge.board.say_bytes(b"garbage" + good[:5])
    bridge.board.say(reports.VelocityReport(30000, 0))

    def counted() -> bool:
        link = bridge.link()
        wanted = {"wrong_address", "bad_crc", "no_magic", "truncated", "implausible"}
        return link is not None and wanted <= set(link.rejected)

    wait_until(counted, "every reason counted")
    assert not any(bumper.pressed for bumper in bridge.seen["tel/bridge/bumper"])
    assert "contact" not in bridge.events()


def test_sigterm_stops_until_the_vehicle_stands_and_leaves_with_zero(bridge: BridgeFixture) -> None:
    bridge.drive()
    bridge.board.speed_mmps = 0
    bridge.process.terminate()
    assert bridge.process.wait(10) == 0
    assert bridge.board.last().kind is MotionKind.STOP  # type: ignore[union-attr]


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
