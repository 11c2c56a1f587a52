"""The bridge as a process: real UDP on one side, a real router on the other; and its ends."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from common.config import Sources, load
from common.loop import Loop
from common.service import Node, serve
from common.wire import framing, reports
from common.wire.commands import MotionKind
from services.bridge.bridge import Bridge
from services.bridge.config import BridgeConfig
from t2 import codec, keys
from t2 import messages as m
from t2.messages import Command
from tests.bridge.conftest import BridgeFixture, bridge_command
from verification.harness.bus import bus_on, running
from verification.harness.fake_board import Board, board
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until


def send_request(bridge: BridgeFixture, call: Any, request: Any) -> Any:
    answers: list[Any] = []
    done = threading.Event()

    def take(answer: Any) -> None:
        answers.append(answer)
        done.set()

    bridge.bus.call(call, request, take, take)
    assert done.wait(10)
    return answers[0]


def test_reports_reach_the_bus_with_their_raw_frames_and_calls_the_board(
    bridge: BridgeFixture,
) -> None:
    names = ["velocity", "mileage", "ultrasonic", "bumper", "driver/left", "driver/right"]
    wait_until(lambda: {f"tel/bridge/{name}" for name in names} <= set(bridge.seen), "all streams")
    wait_until(lambda: (s := bridge.newest("tel/bridge/switches")) and s.bumper_brake, "its echo")
    assert bridge.board.motions[0].kind is MotionKind.BREAK
    assert bridge.newest("tel/bridge/mileage").distance == 1.0
    assert bridge.seen["tel/bridge/bumper"][0].raw == framing.pack(reports.BumperReport(False))
    assert bridge.newest("tel/bridge/ultrasonic").ranges == (1.0,) * 8

    def switched(on: bool) -> bool:
        """Return whether the board's echo answers a call with the newest heartbeat."""
        request = m.SwitchesRequest(bumper_brake=on, echo=bridge.heartbeat)
        answer = send_request(bridge, keys.SET_SWITCHES, request)
        return isinstance(answer, m.Switches) and answer.bumper_brake is on

    wait_until(lambda: switched(False), "an answer")  # until safety's state has arrived there
    assert switched(True)
    lamp = m.LedRequest(channel=3, mode=1)
    assert isinstance(send_request(bridge, keys.SET_LED, lamp), m.Done)
    assert bridge.board.leds[0].channel == 3


def test_an_emergency_stop_is_braked_for_until_safety_acknowledges_it(
    bridge: BridgeFixture,
) -> None:
    bridge.drive()
    session = bridge.bus.sessions[0].zenoh
    assert session is not None
    session.put(keys.estop_key("001"), b"")
    bridge.board.wait_for(MotionKind.BREAK)
    time.sleep(0.3)  # safety requests RUN as if it had not received it
    assert bridge.board.motions[-1].kind is MotionKind.BREAK


def test_a_motion_from_the_router_is_not_even_read(bridge: BridgeFixture) -> None:
    bridge.drive()
    rejected = m.Motion(command=Command.RUN, linear=0.9, boot=bridge.bus.boot, seq=2**62)
    with running(Loop()) as loop, bus_on(bridge.endpoint, loop, lambda _: None) as foreign:
        session = foreign.sessions[0].zenoh
        assert session is not None
        for _ in range(25):
            session.put(keys.MOTION.on("001"), codec.encode(rejected))
            time.sleep(0.02)
    assert not any(motion.linear_mmps == 900 for motion in bridge.board.motions)
    assert "second_authority" not in bridge.events()
    bridge.board.wait_for(MotionKind.RUN, 500)


# --- its ends: the board is not left with a RUN, for it stops nothing by itself -----------------


def child_of(pid: int) -> int:
    """Return the child of a supervisor or guard, once there is one."""
    children = Path(f"/proc/{pid}/task/{pid}/children")
    return int(wait_until(lambda: children.read_text().split(), "a child")[0])


def ended(made: Board, last: int) -> None:
    """Wait for the end of the last process that sends, after which no frame comes."""
    wait_until(lambda: not Path(f"/proc/{last}").exists(), "its end")
    count = len(made.motions)
    time.sleep(0.3)
    assert len(made.motions) == count


def breaks_since(made: Board, count: int) -> int:
    """Return how many BRAKEs the board received after that many commands."""
    return [motion.kind for motion in made.motions[count:]].count(MotionKind.BREAK)


def test_a_bridge_whose_guard_is_killed_stops_the_vehicle_and_ends(bridge: BridgeFixture) -> None:
    bridge.drive()
    pid = child_of(bridge.process.pid)
    assert os.getsid(pid) == pid  # a kill of the guard's session spares the bridge
    for each in (pid, bridge.process.pid):  # as systemd does when the guard hangs
        os.kill(each, signal.SIGQUIT)
    assert bridge.process.wait(20) == -signal.SIGQUIT
    bridge.board.wait_for(MotionKind.STOP)
    ended(bridge.board, pid)
    wait_until(lambda: "guard_gone" in bridge.events(), "the event")


def test_a_hang_up_for_both_comes_to_rest_with_stop_and_leaves_no_break(
    bridge: BridgeFixture,
) -> None:
    bridge.drive()
    count = len(bridge.board.motions)
    os.kill(child_of(bridge.process.pid), signal.SIGHUP)
    bridge.process.send_signal(signal.SIGHUP)
    assert bridge.process.wait(20) == 0
    assert breaks_since(bridge.board, count) == 0
    bridge.board.wait_for(MotionKind.STOP)


def test_a_restarted_bridge_holds_the_brake_of_the_one_before(bridge: BridgeFixture) -> None:
    """Until safety's first motion, however late; one that held none sends STOP by itself."""

    def restarted() -> int:
        """Kill the bridge while no safety commands; return the number of frames before it."""
        bridge.driving = None
        count, boot = len(bridge.board.motions), bridge.newest("tel/bridge/link").boot
        os.kill(child_of(bridge.process.pid), signal.SIGKILL)
        wait_until(lambda: bridge.newest("tel/bridge/link").boot != boot, "the next bridge")
        return count

    bridge.drive()
    bridge.driving = {"command": Command.BRAKE}
    bridge.board.wait_for(MotionKind.BREAK)
    for _ in range(2):
        count = restarted()
        bridge.beats(80)  # 4 s, more than the time of a start
        assert breaks_since(bridge.board, count) == len(bridge.board.motions) - count
    bridge.driving = {"command": Command.STOP}
    bridge.board.wait_for(MotionKind.STOP)
    count = restarted()
    bridge.board.wait_for(MotionKind.STOP)
    assert breaks_since(bridge.board, count)


SUPERVISOR = """
import sys
from cli.run.supervisor import Supervisor
Supervisor({"bridge": sys.argv[1:]}).run()
"""


def test_a_killed_supervisor_leaves_a_vehicle_that_was_braked() -> None:
    """The guard passes two signals on: the second one brakes a bridge that waits for rest."""
    with board() as made:
        command = [sys.executable, "-c", SUPERVISOR, *bridge_command(made, "tcp/127.0.0.1:1")]
        supervisor = subprocess.Popen(command)
        made.wait_for(MotionKind.STOP)
        guard = child_of(supervisor.pid)
        count, killed_s = len(made.motions), time.monotonic()
        supervisor.kill()
        supervisor.wait()
        wait_until(lambda: breaks_since(made, count), "BRAKE, not the STOP of a normal end")
        ended(made, guard)
        made.wait_for(MotionKind.BREAK)
        assert made.times[-1] - killed_s < 5.0


def test_a_board_that_has_not_sent_is_reported_again(monkeypatch: pytest.MonkeyPatch) -> None:
    sets = [f"board.listen_ports={free_port(socket.SOCK_DGRAM)}"]
    node = Node("bridge", load(BridgeConfig, Sources(environ={}, sets=sets)))
    bridge, texts = Bridge(node), []
    monkeypatch.setattr(node.log, "warning", lambda text, **_: texts.append(text))
    for _ in range(15):
        bridge._on_second(0)
    assert texts == ["no frame from 127.0.0.1:4003 yet; run `t2 doctor`"] * 2
    bridge._sockets.close()
    node.close()


def test_a_bug_of_ours_leaves_a_break() -> None:
    counts: list[int] = []

    def bug(_: int) -> None:
        made.wait_for(MotionKind.BREAK)
        counts.append(len(made.motions))
        raise ZeroDivisionError

    with board() as made:
        sets = [
            f"board.port={made.address[1]}",
            f"board.listen_ports={made.ports}",
            "bus.connect=tcp/127.0.0.1:1",
        ]
        node = Node("bridge", load(BridgeConfig, Sources(environ={}, sets=sets)))
        bridge = Bridge(node)
        node.loop.every(1.0, bug)
        with pytest.raises(ZeroDivisionError):
            serve(node)
        wait_until(lambda: breaks_since(made, counts[0]), "BRAKE")
        bridge._sockets.close()  # the end of the process does it otherwise
