"""Checks with dead and hostile peers, by plain Zenoh; each returns its observation."""

import contextlib
import math
import threading
import time
from collections.abc import Callable, Iterator

from verification.harness.ports import accepts_connections
from verification.harness.waiting import wait_until
from verification.ros2.fixture import GATEWAY, MARGIN_S, PATIENCE_S, Robot
from verification.ros2.plain_peer import (
    PERIOD_S,
    QOS,
    TWIST,
    Endpoint,
    PlainPeer,
    Twist,
)
from verification.ros2.tcp_proxy import HOST, TcpProxy

FORWARD = Twist(0.4)
HELD_S = 2.0
FLOOD_S = 3.0
STILL_M = 0.01
WRONG_HASH = TWIST[:-8] + "00000000"


class Driver:
    """Publishes the current command at 20 Hz in a thread; None publishes nothing."""

    def __init__(self, peer: PlainPeer, publisher: Endpoint) -> None:
        self.twist: Twist | None = Twist()
        self._peer, self._publisher = peer, publisher
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop publishing."""
        self._ends.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ends.wait(PERIOD_S):
            if (twist := self.twist) is not None:
                self._peer.send(self._publisher, twist)


@contextlib.contextmanager
def plain_peer(endpoint: str) -> Iterator[PlainPeer]:
    """Open a peer; its session ends with the context."""
    peer = PlainPeer(endpoint)
    try:
        yield peer
    finally:
        peer.close()


@contextlib.contextmanager
def driver(peer: PlainPeer, about: str = TWIST) -> Iterator[Driver]:
    """Publish commands as long as the context."""
    publisher = peer.commands(about)
    made = Driver(peer, publisher)
    try:
        yield made
    finally:
        made.close()
        publisher.close()


def moves(robot: Robot, driving: Driver) -> None:
    """Publish neutral commands until the publisher is taken, then motion; wait for it."""
    driving.twist = Twist()
    time.sleep(1.0)
    driving.twist = FORWARD
    robot.wait_motion()


def reset_if_latched(robot: Robot, peer: PlainPeer) -> None:
    """Wait until safety publishes again; reset what is latched."""
    before = robot.state
    wait_until(lambda: robot.state is not before, "a state of safety", PATIENCE_S)
    end_s, message = time.monotonic() + PATIENCE_S, ""
    while time.monotonic() < end_s and not robot.is_ready():
        if robot.latched():
            _, message = peer.call("/hardware/e_stop_reset")
        time.sleep(0.2)
    assert robot.is_ready(), f"{message} {robot.state}"


def gateway_killed(robot: Robot) -> str:
    """Kill the gateway while ROS drives; restart it and drive again."""
    with plain_peer(robot.stack.endpoint) as peer, driver(peer) as driving:
        moves(robot, driving)
        observed = robot.stops_within_lease(robot.stack.kill(GATEWAY))
        assert robot.ended() == [GATEWAY], robot.ended()
        assert not robot.latched(), robot.state
        wait_until(lambda: not _ours(peer), "no token of a killed gateway")
        wait_until(robot.is_ready, "safety ready without the gateway")
        robot.stack.start(GATEWAY)
        wait_until(lambda: _ours(peer), "tokens of the restarted gateway")
        moves(robot, driving)
    robot.wait_standstill()
    return f"{observed}; no latch; the restarted gateway is in the graph and drives"


def _ours(peer: PlainPeer) -> list[str]:
    return [token for token in peer.tokens() if "/%/%/t2" in token]


def safety_killed(robot: Robot) -> str:
    """Call the emergency stop while safety is dead; the reply reports that nothing confirms it."""
    with plain_peer(robot.stack.endpoint) as peer, driver(peer) as driving:
        moves(robot, driving)
        robot.stops_within_lease(robot.stack.kill("safety"))
        driving.twist = Twist()
        success, message = peer.call("/hardware/e_stop_trigger")
        assert not success, message
        robot.stack.start("safety")
        reset_if_latched(robot, peer)
        moves(robot, driving)
    robot.wait_standstill()
    return f"stops; the reply is success=false, {message!r}; drives after the restart"


def router_killed(robot: Robot) -> str:
    """Kill the router while ROS drives; restart it and drive again."""
    with plain_peer(robot.stack.endpoint) as peer, driver(peer) as driving:
        moves(robot, driving)
        observed = robot.stops_within_lease(robot.stack.kill("router"))
        robot.stack.start("router")
    wait_until(lambda: accepts_connections(robot.port), "the router listens", PATIENCE_S)
    with plain_peer(robot.stack.endpoint) as peer, driver(peer) as driving:
        wait_until(lambda: _ours(peer), "tokens of the gateway", PATIENCE_S)
        reset_if_latched(robot, peer)
        moves(robot, driving)
    robot.wait_standstill()
    return f"{observed}; the gateway connects again and drives"


def flood(robot: Robot) -> str:
    """Publish as fast as possible from a second node; it never moves the vehicle."""
    endpoint = robot.stack.endpoint
    with plain_peer(endpoint) as one, plain_peer(endpoint) as two, driver(one) as driving:
        moves(robot, driving)
        publisher, backward, count = two.commands(), Twist(-0.4), 0
        end_s = time.monotonic() + FLOOD_S
        while time.monotonic() < end_s:
            two.send(publisher, backward)
            count += 1
        publisher.close()
        assert not robot.ended(), robot.ended()
        backwards = [it for it in robot.frames.follow().commands if it.linear < 0]
        assert not backwards, backwards[:3]
        moves(robot, driving)
    robot.wait_standstill()
    return f"{count / FLOOD_S:.0f} puts per second: no motion by them, drives afterwards"


def second_publisher(robot: Robot) -> str:
    """Publish from two nodes; the second one is refused until the first one is silent."""
    endpoint = robot.stack.endpoint
    with plain_peer(endpoint) as one, plain_peer(endpoint) as two:
        with driver(one) as first, driver(two) as second:
            second.twist = None
            moves(robot, first)
            before = robot.counters.get("cmd_vel_second_publisher", 0)
            second.twist = Twist(-0.4)
            robot.wait_counter("cmd_vel_second_publisher", before + 10)
            assert robot.truth().linear > 0.1, robot.truth()
            first.twist = None
            time.sleep(0.6)
            second.twist = Twist()
            time.sleep(0.5)
            second.twist = Twist(-0.4)
            robot.wait_motion(-1)
        robot.wait_standstill()
    return "the first drives, the second is refused; it drives when the first is silent"


def not_finite(robot: Robot) -> str:
    """Publish NaN and infinity; both are refused."""
    for value in (math.nan, math.inf):
        _refused(robot, Twist(value), "cmd_vel_not_finite")
    return "refused, no motion, drives afterwards"


def sideways(robot: Robot) -> str:
    """Publish motion to the side; it is refused."""
    _refused(robot, Twist(linear=0.4, lateral=0.2), "cmd_vel_other_axes")
    return "refused, no motion, drives afterwards"


def _refused(robot: Robot, twist: Twist, counter: str) -> None:
    """Check that a command that is published instead of a good one stops the vehicle."""
    with plain_peer(robot.stack.endpoint) as peer, driver(peer) as driving:
        moves(robot, driving)
        before, since_ns = robot.counters.get(counter, 0), time.monotonic_ns()
        driving.twist = twist
        robot.wait_counter(counter, before + 10)
        robot.stops_within_lease(since_ns)
        moves(robot, driving)
    robot.wait_standstill()


def wrong_hash(robot: Robot) -> str:
    """Publish with another type hash; nothing arrives, nothing breaks."""
    with plain_peer(robot.stack.endpoint) as peer:
        with driver(peer, WRONG_HASH) as driving:
            before = robot.distance()
            time.sleep(1.0)
            driving.twist = FORWARD
            time.sleep(2.0)
            assert robot.distance() - before < STILL_M, robot.truth()
            assert not robot.ended(), robot.ended()
        with driver(peer) as driving:
            moves(robot, driving)
    robot.wait_standstill()
    return "no motion; a publisher with the right hash drives"


def garbage(robot: Robot) -> str:
    """Publish no CDR, no attachment, a foreign attachment and broken tokens; nothing breaks."""
    with plain_peer(robot.stack.endpoint) as peer, driver(peer) as driving:
        moves(robot, driving)
        publisher = peer.commands()
        before = robot.counters.get("cmd_vel_unreadable", 0)
        good = Twist(-0.4).encode()
        for payload, attachment in _broken(publisher, good):
            peer.session.put(publisher.key, payload, attachment=attachment)
        tokens = [
            peer.session.liveliness().declare_token(f"@ros2_lv/0/{rest}")
            for rest in ("x", f"a/0/1/MP/%/%/n/%cmd_vel/x/y/{QOS}", "a/b/c/d/e/f/g/h/i/j/k/l/m/n")
        ]
        count = robot.wait_counter("cmd_vel_unreadable", before + 3)
        assert robot.truth().linear > 0.1, robot.truth()
        assert not robot.ended(), robot.ended()
        del tokens
    robot.wait_standstill()
    return f"{count - before} messages refused; the publisher that drives is not disturbed"


def _broken(publisher: Endpoint, good: bytes) -> Iterator[tuple[bytes, bytes | None]]:
    yield good, None
    yield good, b"\0" * 33
    yield good[:20], publisher.attachment()
    yield b"", publisher.attachment()
    yield b"\0\0\0\0" + good[4:], publisher.attachment()
    yield good[:12] + b"\xff" * 4 + good[16:], publisher.attachment()


def held_back(robot: Robot) -> str:
    """Hold commands back and release them in a burst; the vehicle does not move on it."""
    with (
        TcpProxy(robot.port) as proxy,
        plain_peer(f"tcp/{HOST}:{proxy.port}") as peer,
        driver(peer) as driving,
    ):
        moves(robot, driving)
        before = robot.counters.get("cmd_vel_held_back", 0)
        with proxy.hold():
            since_ns = time.monotonic_ns()
            driving.twist = Twist()  # what safety wants before motion
            time.sleep(HELD_S / 4)
            driving.twist = FORWARD
            time.sleep(HELD_S / 4)
            driving.twist = None
            observed = robot.stops_within_lease(since_ns)
            time.sleep(HELD_S / 2)
            rest = robot.distance()
        time.sleep(robot.lease_s + MARGIN_S)
        moved = robot.distance() - rest
        assert moved < STILL_M, f"moved {moved:.2f} m on the burst"
        count = robot.wait_counter("cmd_vel_held_back", before + 10)
        moves(robot, driving)
    robot.wait_standstill()
    return f"{observed}; {count - before} held commands refused, no motion; then drives again"


CHECKS: tuple[Callable[[Robot], str], ...] = (
    gateway_killed, safety_killed, router_killed, second_publisher, flood, not_finite, sideways,
    wrong_hash, garbage, held_back,
)  # fmt: skip
