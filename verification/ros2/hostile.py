"""Checks with hostile peers, by plain Zenoh; each returns its observation."""

import math
import time
from collections.abc import Callable, Iterator, Sequence

from common import clock
from verification.harness.waiting import wait_until
from verification.ros2.driving import FORWARD, driver, moves, plain_peer
from verification.ros2.fixture import STILL_M, Robot
from verification.ros2.plain_peer import QOS, TWIST, Endpoint, Twist

FLOOD_S, FLOOD_HZ = 3.0, 500  # at least, at the gateway
WRONG_HASH = TWIST[:-8] + "00000000"


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
        before, since_ns = robot.counters.get(counter, 0), clock.now_ns()
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


def flood(robot: Robot) -> str:
    """Publish as fast as possible from a second node; nothing ends, and the first drives again.

    The first one's commands are late meanwhile. The second one never sends a neutral command, so it
    must not drive.
    """
    endpoint = robot.stack.endpoint
    with plain_peer(endpoint) as one, plain_peer(endpoint) as two, driver(one) as driving:
        moves(robot, driving)
        publisher, backward, count = two.commands(), Twist(-0.4), 0
        before = robot.refused()
        end_s = time.monotonic() + FLOOD_S
        while time.monotonic() < end_s:
            two.send(publisher, backward, blocks=True)  # else this side drops most of them
            count += 1
        publisher.close()
        enough = before + FLOOD_S * FLOOD_HZ
        wait_until(lambda: robot.refused() > enough, f"{enough:.0f} commands: {robot.counters}")
        assert not robot.ended(), robot.ended()
        moves(robot, driving)
        reversals = [it for it in robot.frames.follow().commands if it.linear < 0]
        assert not reversals, f"{len(reversals)} frames backward"
    robot.wait_standstill()
    arrived = robot.refused() - before
    return f"{count} puts, {arrived} refused; the first drives again"


CHECKS: Sequence[Callable[[Robot], str]] = (
    second_publisher, flood, not_finite, sideways, wrong_hash, garbage,
)  # fmt: skip
