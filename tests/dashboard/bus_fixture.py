"""The other programs on the bus of a dashboard under test."""

import time
from typing import Any

from common import clock
from common.bus.bus import Bus
from common.freshness import NS_PER_S
from common.loop import Loop
from t2 import keys
from t2.messages import Cause, Drive, Limit, LimitState, MapPose, PatrolState, Release
from tests import factories
from tests.dashboard.viewer import Client
from tests.factories import safety_state
from verification.harness.waiting import PATIENCE_S, wait_until

HOLD = {"x": 1.0, "y": 0.0}


class Peer:
    """A simulated safety, and subscribers for requests and stops."""

    def __init__(self, loop: Loop) -> None:
        self.requests: list[Drive] = []
        self.estops: list[int] = []
        self.safe = True
        self.latched: tuple[str, ...] = ()
        self.causes: tuple[Cause, ...] = ()
        self.release: Release | None = None
        self.release_refusal = ""
        self.map_pose: MapPose | None = None
        self.patrol: PatrolState | None = None
        self.keepalives: tuple[LimitState, ...] = ()
        self.kept_alive: list[Limit] = []
        self.boot = 0  # of safety
        self._loop = loop

    def declare(self, bus: Bus) -> None:
        self.boot = bus.boot
        state, map_pose = bus.publisher(keys.SAFETY), bus.publisher(keys.MAP_POSE)
        odometry, patrol = bus.publisher(keys.ODOMETRY), bus.publisher(keys.PATROL)
        bus.subscribe(
            keys.DRIVE, lambda it: self.requests.append(it.message), source="web", depth=64
        )
        bus.subscribe(keys.LIMIT, lambda it: self.kept_alive.append(it.message), source="web")
        bus.on_any(keys.estop_key("001"), self.estops.append)
        bus.live(keys.live_key("two words", "bridge", "x"))
        bus.live(keys.live_key("002", "bridge", "x"))

        def publish(now_ns: int) -> None:
            if self.map_pose:
                map_pose.put(self.map_pose)
                odometry.put(factories.odometry())
            if self.patrol:
                patrol.put(self.patrol)
            if self.safe:
                state.put(
                    safety_state(
                        heartbeat=now_ns,
                        source="web",
                        latched=self.latched,
                        causes=self.causes,
                        release=self.release,
                        release_refusal=self.release_refusal,
                        limit_sources=self.keepalives,
                    )
                )

        self._loop.post(lambda: self._loop.every(0.05, publish))

    def wait_for_silence(self) -> None:
        """Wait until no stop was received for 0.5 s; the dashboard repeats one each 50 ms."""
        count, since_ns = len(self.estops), clock.now_ns()

        def over() -> bool:
            nonlocal count, since_ns
            if len(self.estops) != count:
                count, since_ns = len(self.estops), clock.now_ns()
            return clock.now_ns() - since_ns > NS_PER_S // 2

        wait_until(over, "no more stops")

    def moving(self) -> bool:
        return bool(self.requests) and self.requests[-1].linear > 0

    def zeros(self) -> int:
        """Return the number of zeros at the end."""
        count = 0
        while count < len(self.requests) and not self.requests[-1 - count].linear:
            count += 1
        return count


def drive(it: Client, peer: Peer) -> None:
    """Answer every snapshot with a push until drive requests are sent."""
    deadline = time.monotonic() + PATIENCE_S
    while not peer.moving():
        assert time.monotonic() < deadline, "no drive request was sent"
        snapshot = it.next_snapshot()
        if snapshot["driver"]["hold"] == "lapsed":
            it.send("free")  # the host has stalled
        else:
            it.send("hold", echo=echo_of(snapshot), **HOLD)


def echo_of(snapshot: dict[str, Any]) -> int:
    """Return the heartbeat of safety that a snapshot shows; 0 without a state."""
    return int(snapshot["safety"]["heartbeat"]) if snapshot["safety"] else 0
