"""Checks with plain Zenoh peers: hostile, held back, of older versions; and dead processes."""

import contextlib
import json
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from common import clock
from verification.harness.ports import accepts_connections
from verification.harness.trace import last_move_s
from verification.harness.waiting import becomes_true, wait_until
from verification.ros2 import plain_peer
from verification.ros2.plain_peer import COMMANDS, FORWARD, QOS, Driver, Endpoint, PlainPeer, Twist
from verification.ros2.robot import GATEWAY, MARGIN_S, PATIENCE_S, STILL_M, Robot

HELD_S = 2.0
ATTEMPTS = 3
FLOOD_S, FLOOD_HZ = 3.0, 500  # at least, at the gateway
BACKWARD = Twist(-0.4)
STOP, RESET = "/hardware/e_stop_trigger", "/hardware/e_stop_reset"


class TcpProxy:
    """Forwards a connection to a port of loopback; ``held`` stops what the client sends.

    What the server sends still arrives meanwhile, so that neither side notices it early.
    """

    def __init__(self, port: int) -> None:
        self._target = port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._sockets = [self._listener]
        self._flows = threading.Event()
        self._flows.set()
        self.endpoint = f"tcp/127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        """Close all connections."""
        for sock in self._sockets:
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)  # wakes the thread that waits for it
            sock.close()

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Hold back what the client sends; release all of it at the end of the context."""
        self._flows.clear()
        try:
            yield
        finally:
            self._flows.set()

    def _accept(self) -> None:
        client, _ = self._listener.accept()
        server = socket.create_connection(("127.0.0.1", self._target))
        self._sockets += [client, server]
        for sock in (client, server):
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        threading.Thread(target=self._forward, args=(server, client, False), daemon=True).start()
        self._forward(client, server, True)

    def _forward(self, source: socket.socket, sink: socket.socket, held: bool) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                if held:
                    self._flows.wait()
                sink.sendall(data)
            sink.shutdown(socket.SHUT_WR)


@contextlib.contextmanager
def driver(endpoint: str) -> Iterator[tuple[PlainPeer, Driver]]:
    """Open a peer that publishes commands as long as the context."""
    with contextlib.closing(PlainPeer(endpoint)) as peer:
        driving = Driver(peer)
        try:
            yield peer, driving
        finally:
            driving.close()


def start_motion(robot: Robot, driving: Driver) -> None:
    """Publish neutral commands until the publisher is taken, then motion; wait for it.

    A busy host changes the delay of commands; then the publisher has to be neutral again.
    """
    for _ in range(ATTEMPTS):
        driving.twist = Twist()
        time.sleep(1.0)
        driving.twist = FORWARD
        if becomes_true(robot.is_driving, PATIENCE_S / ATTEMPTS):
            return
    raise AssertionError(f"no motion; safety: {robot.state and robot.state.text}")


def reset_if_latched(robot: Robot, peer: PlainPeer) -> None:
    """Wait until safety publishes again; reset what is latched."""
    before = robot.state
    wait_until(lambda: robot.state is not before, "a state of safety", PATIENCE_S)

    def ready() -> bool:
        if robot.latched():
            peer.call(RESET)
        return robot.is_ready()

    wait_until(ready, "safety ready", PATIENCE_S)


def garbage(robot: Robot) -> str:
    """Publish no CDR, no attachment, a foreign attachment and broken tokens; nothing breaks."""
    with driver(robot.stack.endpoint) as (peer, driving):
        start_motion(robot, driving)
        publisher = Endpoint(peer.session, *COMMANDS)
        for payload, attachment in broken(publisher, BACKWARD.encode()):
            peer.session.put(publisher.key, payload, attachment=attachment)
        tokens = [
            peer.session.liveliness().declare_token(f"@ros2_lv/0/{rest}")
            for rest in ("x", f"a/0/1/MP/%/%/n/%cmd_vel/x/y/{QOS}", "a/b/c/d/e/f/g/h/i/j/k/l/m/n")
        ]
        wait_until(lambda: robot.counters.get("cmd_vel_unreadable", 0) >= 3, "refusals")
        robot.wait_motion()
        robot.check_processes()
        del tokens
    return "messages refused; the publisher that drives is not disturbed"


def broken(publisher: Endpoint, good: bytes) -> Iterator[tuple[bytes, bytes | None]]:
    """Yield payloads and attachments of which none is a command."""
    yield good, None
    yield good, b"\0" * 33
    yield good[:20], publisher.attachment()
    yield b"", publisher.attachment()
    yield b"\0\0\0\0" + good[4:], publisher.attachment()
    yield good[:12] + b"\xff" * 4 + good[16:], publisher.attachment()


def flood(robot: Robot) -> str:
    """Publish as fast as possible from a second node; nothing ends, and the first drives again.

    The first one's commands are late meanwhile. The second one never sends a neutral command, so it
    must not drive.
    """
    endpoint = robot.stack.endpoint
    with driver(endpoint) as (_, driving), contextlib.closing(PlainPeer(endpoint)) as other:
        start_motion(robot, driving)
        publisher, before = Endpoint(other.session, *COMMANDS), sum(robot.counters.values())
        end_s = time.monotonic() + FLOOD_S
        while time.monotonic() < end_s:
            publisher.send(BACKWARD, blocks=True)  # else this side drops most of them
        publisher.close()
        enough = before + FLOOD_S * FLOOD_HZ
        wait_until(lambda: sum(robot.counters.values()) > enough, f"{enough:.0f} refusals")
        robot.check_processes()
        start_motion(robot, driving)
        reversals = [it for it in robot.frames.follow().commands if it.linear < 0]
        assert not reversals, f"{len(reversals)} frames backward"
    return f"{sum(robot.counters.values()) - before} refused; the first drives again"


def held_commands(robot: Robot) -> str:
    """Hold commands back and release them in a burst; the vehicle does not move on it."""
    with (
        contextlib.closing(TcpProxy(robot.port)) as proxy,
        driver(proxy.endpoint) as (_, driving),
    ):
        start_motion(robot, driving)
        with proxy.held():
            since_ns = clock.now_ns()
            for twist in (Twist(), FORWARD, None):  # neutral: what safety wants before motion
                driving.twist = twist
                time.sleep(HELD_S / 3)
            observed = robot.stops_within_lease(since_ns)
            rest = robot.distance()
        time.sleep(robot.lease_s + MARGIN_S)
        moved = robot.distance() - rest
        assert moved < STILL_M, f"moved {moved:.2f} m on the burst"
        start_motion(robot, driving)
        assert robot.counters.get("cmd_vel_held_back", 0) >= 10, robot.counters
    return f"{observed}; no motion on the burst, then drives again"


def held_reset(robot: Robot) -> str:
    """Hold a reset back until a newer emergency stop; it does not clear that one."""
    replies: list[tuple[bool, str]] = []
    with (
        contextlib.closing(TcpProxy(robot.port)) as proxy,
        contextlib.closing(PlainPeer(robot.stack.endpoint)) as other,
        contextlib.closing(PlainPeer(proxy.endpoint)) as peer,
    ):
        assert other.call(STOP)[0]
        with proxy.held():
            thread = threading.Thread(target=lambda: replies.append(peer.call(RESET)))
            thread.start()
            time.sleep(HELD_S)
            reset_if_latched(robot, other)
            assert other.call(STOP)[0]
            time.sleep(HELD_S)  # its cause is no longer present: a new reset would clear it
        thread.join(PATIENCE_S)
        assert robot.latched(), f"a held reset cleared a newer stop: {replies}"
        assert replies, "the held reset has no reply"
        assert not replies[0][0], replies
    return f"still latched; the reply is success=false, {replies[0][1]!r}"


def killed(robot: Robot, name: str) -> str:
    """Kill a process while ROS drives; the vehicle stops, and drives again after its restart."""
    with driver(robot.stack.endpoint) as (peer, driving):
        start_motion(robot, driving)
        observed = robot.stops_within_lease(robot.stack.kill(name))
        driving.twist = Twist()
        if name == "safety":
            success, message = peer.call(STOP)
            assert not success, f"nothing confirms the stop: {message}"
        if name == GATEWAY:
            wait_until(robot.is_ready, "safety ready without the gateway")
            wait_until(lambda: not peer.sees_gateway(), "no token of a killed gateway")
        robot.stack.start(name)
        wait_until(lambda: accepts_connections(robot.port), "the router listens", PATIENCE_S)
    with driver(robot.stack.endpoint) as (peer, driving):
        wait_until(peer.sees_gateway, "tokens of the gateway", PATIENCE_S)
        reset_if_latched(robot, peer)
        start_motion(robot, driving)
    robot.wait_standstill()
    return f"{observed}; drives after the restart"


def version(robot: Robot, python: Path) -> str:
    """Run the plain peer with an older Zenoh; compare what it did with the board's commands."""
    command = [str(python), "-P", plain_peer.__file__, robot.stack.endpoint]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120.0, check=False)
    assert done.returncode == 0, done.stderr[-800:]
    found = json.loads(done.stdout.splitlines()[-1])
    assert '<robot name="t2">' in found["description"], found["description"][:80]
    assert found["stop"][0], found
    assert found["reset"][0], found
    assert robot.distance() > 0.1, "no motion"
    commands = robot.frames.follow().commands
    brake_ns = next(each.mono_ns for each in commands if each.kind == "brake")
    assert last_move_s(commands, brake_ns) == 0, "motion after the stop"
    return f"Zenoh {found['zenoh']}: {robot.distance():.2f} m, stop, no motion while latched, reset"


CHECKS: tuple[Callable[[Robot], str], ...] = garbage, flood, held_commands, held_reset
