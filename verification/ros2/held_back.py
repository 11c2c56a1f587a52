"""Checks with a network that holds messages back; each returns its observation."""

import threading
import time
from collections.abc import Callable, Sequence

from common import clock
from verification.ros2.driving import FORWARD, driver, moves, plain_peer, reset_if_latched
from verification.ros2.fixture import MARGIN_S, PATIENCE_S, STILL_M, Robot
from verification.ros2.plain_peer import Twist
from verification.ros2.tcp_proxy import HOST, TcpProxy

HELD_S = 2.0


def commands(robot: Robot) -> str:
    """Hold commands back and release them in a burst; the vehicle does not move on it."""
    with (
        TcpProxy(robot.port) as proxy,
        plain_peer(f"tcp/{HOST}:{proxy.port}") as peer,
        driver(peer) as driving,
    ):
        moves(robot, driving)
        before = robot.counters.get("cmd_vel_held_back", 0)
        with proxy.hold():
            since_ns = clock.now_ns()
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


def first_commands(robot: Robot) -> str:
    """Hold the first commands of a new publisher back; the vehicle does not move on the burst."""
    with (
        TcpProxy(robot.port) as proxy,
        plain_peer(f"tcp/{HOST}:{proxy.port}") as peer,
        driver(peer) as driving,
    ):
        driving.twist = None
        before = robot.distance()
        with proxy.hold():
            driving.twist = Twist()
            time.sleep(HELD_S / 2)
            driving.twist = FORWARD
            time.sleep(HELD_S / 2)
            driving.twist = None
            time.sleep(HELD_S / 2)
        time.sleep(robot.lease_s + MARGIN_S)
        moved = robot.distance() - before
        assert moved < STILL_M, f"moved {moved:.2f} m on the burst"
        moves(robot, driving)
    robot.wait_standstill()
    return "no motion on the burst; then drives"


def reset(robot: Robot) -> str:
    """Hold a reset back until a newer emergency stop; it does not clear that one."""
    replies: list[tuple[bool, str]] = []
    with (
        plain_peer(robot.stack.endpoint) as other,
        TcpProxy(robot.port) as proxy,
        plain_peer(f"tcp/{HOST}:{proxy.port}") as peer,
    ):
        assert other.call("/hardware/e_stop_trigger")[0]
        with proxy.hold():
            thread = threading.Thread(
                target=lambda: replies.append(peer.call("/hardware/e_stop_reset"))
            )
            thread.start()
            time.sleep(HELD_S)
            reset_if_latched(robot, other)
            assert other.call("/hardware/e_stop_trigger")[0]
            time.sleep(HELD_S)  # its cause is no longer present: a new reset would clear it
        thread.join(PATIENCE_S)
        assert replies, "the held reset has no reply"
        assert robot.latched(), f"a held reset cleared a newer stop: {replies}"
        assert not replies[0][0], replies
        reset_if_latched(robot, other)
    return f"still latched; the reply is success=false, {replies[0][1]!r}"


CHECKS: Sequence[Callable[[Robot], str]] = commands, first_commands, reset
