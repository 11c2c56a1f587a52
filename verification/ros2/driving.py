"""Driving by a plain peer, in a thread and as long as a context."""

import contextlib
import threading
import time
from collections.abc import Iterator

from verification.harness.waiting import wait_until
from verification.ros2.fixture import PATIENCE_S, Robot
from verification.ros2.plain_peer import PERIOD_S, TWIST, Endpoint, PlainPeer, Twist

FORWARD = Twist(0.4)


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
