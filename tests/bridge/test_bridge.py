"""The bridge as a process: real UDP on one side, a real router on the other."""

import socket
import time

import msgpack
import pytest

from common import codec, keys
from common import messages as m
from common.bus.bus import Bus
from common.bus.drive import DriveLink
from common.bus.publisher import Publisher
from common.loop import Loop
from common.motion import Command
from common.wire import reports
from common.wire.commands import MotionKind
from common.wire.frame import Side
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


def test_nothing_is_published_twice_although_it_comes_to_both_ports(bridge: BridgeFixture) -> None:
    wait_until(lambda: bridge.newest("tel/bridge/link"), "a link")

    def reported(bits: int) -> list[m.Driver]:
        return [d for d in bridge.seen.get("tel/bridge/driver/left", []) if d.bits == bits]

    bridge.board.say(reports.DriverReport(Side.LEFT, 0b1000))
    wait_until(lambda: reported(0b1000), "the fault, unasked")
    wait_until(lambda: "driver_fault" in bridge.events(), "the event")
    for bits in (0b10000, 0b100000):  # the last one comes behind all copies of the first
        bridge.board.say(reports.DriverReport(Side.LEFT, bits))
        wait_until(lambda: reported(bits), "the next fault")  # noqa: B023
    assert len(reported(0b1000)) == 1
    assert reported(0b1000)[0].faults == ("under_voltage",)


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


@pytest.mark.parametrize("speed_mmps", [500, None])
def test_stop_becomes_break_unless_the_vehicle_is_known_to_stand(
    bridge: BridgeFixture, speed_mmps: int | None
) -> None:
    bridge.drive()
    bridge.board.speed_mmps = speed_mmps
    bridge.silence()
    bridge.board.wait_for(MotionKind.BREAK)
    bridge.board.speed_mmps = 0
    bridge.board.wait_for(MotionKind.STOP)


@pytest.mark.parametrize("by", ["counters", "velocities"])
def test_leaving_a_standstill_without_a_command_breaks_until_safety_latches_it(
    bridge: BridgeFixture, by: str
) -> None:
    bridge.drive()
    bridge.board.speed_mmps = 0
    bridge.silence()
    bridge.board.wait_for(MotionKind.STOP)
    wait_until(lambda: [motion.kind for motion in bridge.board.motions[-10:]] == STOPS, "STOPs")
    if by == "counters":
        bridge.board.distance_mm += 60
    else:
        bridge.board.speed_mmps = 100
        wait_until(lambda: "uncommanded_motion" in bridge.events(), "the event")
        bridge.board.speed_mmps = 0
    bridge.board.wait_for(MotionKind.BREAK)
    wait_until(lambda: "uncommanded_motion" in bridge.events(), "the event")
    wait_until(lambda: breaks(bridge) == 20, "BRAKE for a second")
    bridge.rearms = False
    bridge.command(Command.RUN, 0.5)
    wait_until(lambda: (link := bridge.link()) and "without a command" in link.waiting, "waits")
    wait_until(lambda: breaks(bridge) == 20, "BRAKE although a RUN is requested")
    bridge.command(Command.STOP)
    seen = len(bridge.board.motions)
    wait_until(lambda: len(bridge.board.motions) > seen + 40, "two seconds of STOP asked for")
    assert breaks(bridge) == 20
    bridge.rearms = True
    bridge.drive()


def breaks(bridge: BridgeFixture) -> int:
    """Return how many of the last 20 commands were BRAKE."""
    return sum(motion.kind is MotionKind.BREAK for motion in bridge.board.motions[-20:])


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


def test_a_second_authority_is_refused_and_reported(bridge: BridgeFixture) -> None:
    bridge.drive()
    with running(Loop()) as loop:
        other: list[Publisher[m.Motion]] = []

        def declare(bus: Bus) -> None:
            other.append(DriveLink(bus, listens=False).publisher(keys.MOTION))

        with bus_on(bridge.endpoint, loop, declare):
            motion = m.Motion(command=Command.RUN, linear=0.9)

            def beat(_: int) -> None:
                other[0].put(motion)

            loop.post(lambda: loop.every(0.02, beat))
            wait_until(lambda: "second_authority" in bridge.events(), "the event")
    assert not any(motion.linear_mmps == 900 for motion in bridge.board.motions)


@pytest.mark.parametrize("hostile", [float("nan"), float("inf")])
def test_what_is_not_finite_never_reaches_the_board(bridge: BridgeFixture, hostile: float) -> None:
    bridge.drive()
    bridge.command(Command.RUN, hostile)
    bridge.board.wait_for(MotionKind.STOP)


def test_wrong_types_and_garbage_on_motion_are_dropped(bridge: BridgeFixture) -> None:
    bridge.drive()
    session = bridge.bus.sessions[1].zenoh  # the drive link's
    assert session is not None
    for payload in (b"", b"\xc1", msgpack.packb({"command": "fly"}), msgpack.packb([1] * 1000)):
        session.put("t2/v1/001/@cmd/motion", payload)
    bridge.command(Command.STOP)
    bridge.board.wait_for(MotionKind.STOP)
    assert bridge.process.poll() is None


def test_a_silent_board_is_lost_and_its_return_needs_switches_and_a_neutral(
    bridge: BridgeFixture,
) -> None:
    bridge.drive()
    asked = bridge.board.switch_asks
    bridge.board.silent = True
    wait_until(lambda: "link_lost" in bridge.events(), "link lost")
    bridge.board.wait_for(MotionKind.STOP)
    bridge.rearms = False
    bridge.board.silent = False
    wait_until(lambda: (link := bridge.link()) and link.state == "up", "link up")
    wait_until(lambda: bridge.board.switch_asks > asked, "the next request for the switches")
    wait_until(lambda: (link := bridge.link()) and "neutral" in link.waiting, "waits for a neutral")
    assert bridge.board.last().kind is MotionKind.STOP  # type: ignore[union-attr]
    bridge.rearms = True
    bridge.drive()


def test_a_board_that_does_not_echo_is_not_driven(bridge: BridgeFixture) -> None:
    bridge.drive()
    bridge.board.echo = False
    bridge.board.silent = True
    wait_until(lambda: (link := bridge.link()) and link.state == "lost", "link lost")
    bridge.board.silent = False
    wait_until(lambda: "switches_unverified" in bridge.events(), "the event")
    bridge.command(Command.STOP)
    hint = "both on and echoed; a firmware without echoes needs bridge.require_switches = false"
    wait_until(
        lambda: (link := bridge.link()) and hint in link.waiting, "the link names what it waits for"
    )
    bridge.board.echo = True
    bridge.drive()


def test_counters_that_jump_to_zero_start_a_new_epoch(bridge: BridgeFixture) -> None:
    bridge.drive()
    bridge.board.distance_mm = 0
    wait_until(lambda: "board_restarted" in bridge.events(), "the event")
    wait_until(lambda: bridge.newest("tel/bridge/mileage").epoch == 1, "the epoch")
    bridge.drive()


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


def test_a_taken_port_is_said_clearly(endpoint: str) -> None:
    with board() as made, bridge_process(made, endpoint) as first:
        made.wait_for(MotionKind.STOP)
        with bridge_process(made, endpoint) as second:
            assert second.wait(20) == 69
            assert second.stderr is not None
            assert b"is a bridge running already?" in second.stderr.read()
        assert first.poll() is None


def test_bad_settings_end_it_before_anything_opens() -> None:
    with board() as made, bridge_process(made, "tcp/127.0.0.1:1", "bridge.lease=0") as process:
        assert process.wait(20) == 78
        assert process.stderr is not None
        text = process.stderr.read().decode()
    assert "bridge.lease" in text
    assert "0.05..10.0" in text
    assert made.motions == []


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
