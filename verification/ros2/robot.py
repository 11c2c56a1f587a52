"""The stack with its simulator and the gateway, and what ROS peers cause on it."""

import contextlib
import json
import os
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from cli.settings import Everything
from common import child_process, keys
from common.bus.bus import Arrival, Bus
from common.loop import Loop
from common.messages import Health, SafetyState
from verification.harness.bus import bus_on, running, set_options
from verification.harness.stack import RunningStack, running_stack
from verification.harness.trace import TraceFollower, last_move_s, moves
from verification.harness.waiting import wait_until

GATEWAY = "ros2"  # its process and its source of drive requests
STILL_MPS, MOTION_MPS = 0.001, 0.1
STILL_M = 0.01  # no motion
MARGIN_S = 0.2  # of a busy host, added to the lease
PATIENCE_S = 30.0  # of a peer's command, on a busy host


class Robot:
    """A running stack with the gateway, observed on its bus and at its board."""

    def __init__(self, stack: RunningStack, node: Path) -> None:
        self.stack = stack
        self.frames = TraceFollower(stack.trace_file)
        self.state: SafetyState | None = None
        self.counters: Mapping[str, int] = {}  # of the gateway
        self.ros_domain = 0  # of the crate's nodes
        self.lease_s = stack.config.safety.sources[GATEWAY].lease
        self.port = int(stack.endpoint.rsplit(":", 1)[1])  # of the router
        self._node = node

    def declare(self, bus: Bus) -> None:
        """Subscribe to safety's state and the gateway's counters."""

        def on_state(arrival: Arrival[SafetyState]) -> None:
            self.state = arrival.message

        def on_health(arrival: Arrival[Health]) -> None:
            self.counters = arrival.message.counters

        bus.subscribe(keys.SAFETY, on_state)
        bus.subscribe(keys.HEALTH, on_health, service=GATEWAY)

    def node(self, *words: object) -> list[Any]:
        """Run the node of the crate to its end; return the JSON lines that it printed."""
        done = subprocess.run(
            [str(self._node), self.stack.endpoint, *map(str, words)],
            capture_output=True, text=True, timeout=2 * PATIENCE_S, check=False,
            env=os.environ | {"ROS_DOMAIN_ID": str(self.ros_domain)},
        )  # fmt: skip
        assert done.returncode == 0, f"exit code {done.returncode}: {done.stderr[-500:]}"
        lines = done.stdout.splitlines()
        return [json.loads(line) for line in lines if line.startswith(("{", "["))]

    def distance(self) -> float:
        """Return the distance driven since the start, in metres."""
        return self.stack.control.truth().distance

    def latched(self) -> tuple[str, ...]:
        """Return the causes that need a reset; fails without a state."""
        assert self.state is not None, "safety publishes no state"
        return self.state.latched

    def is_ready(self) -> bool:
        """Return whether safety lacks at most a request."""
        return self.state is not None and {it.name for it in self.state.causes} <= {"no_request"}

    def is_moving(self) -> bool:
        """Return whether the board's last command moves the vehicle."""
        commands = self.frames.follow().commands
        return bool(commands) and moves(commands[-1])

    def is_driving(self) -> bool:
        """Return whether the vehicle moves forward by its last command."""
        return self.is_moving() and self.stack.speed() > MOTION_MPS

    def wait_motion(self) -> None:
        """Wait until the vehicle moves forward."""
        wait_until(self.is_driving, "motion", PATIENCE_S)

    def wait_standstill(self) -> None:
        """Wait until the vehicle stands, with no command to move."""
        wait_until(
            lambda: not self.is_moving() and abs(self.stack.speed()) < STILL_MPS,
            "a standstill", PATIENCE_S,
        )  # fmt: skip

    def stops_within_lease(self, since_ns: int) -> str:
        """Check that the last command to move came within the lease; return the observation."""
        self.wait_standstill()
        took_s = last_move_s(self.frames.follow().commands, since_ns)
        assert took_s <= self.lease_s + MARGIN_S, f"moved for {took_s:.3f} s"
        return f"last command to move after {took_s:.3f} s, lease {self.lease_s:.1f} s"

    def check_processes(self) -> None:
        """Check that no process of the stack has ended."""
        ended = [name for name, it in self.stack.processes.items() if it.poll() is not None]
        assert not ended, f"{ended} ended"


@contextlib.contextmanager
def robot_with_gateway(folder: Path, node: Path, sets: Sequence[str] = ()) -> Iterator[Robot]:
    """Run the stack in an empty world; only a request is missing when the context begins.

    ``sets`` are settings of the gateway.
    """

    def beside(config: Everything) -> Mapping[str, list[str]]:
        where = set_options(f"bus.connect={config.bus.endpoints[0]}", *sets)
        return {GATEWAY: child_process.command(f"services.{GATEWAY}", *where)}

    loop = Loop()
    with (
        running_stack(folder, beside=beside) as stack,
        running(loop),
        bus_on(stack.endpoint, loop, (robot := Robot(stack, node)).declare),
    ):
        wait_until(robot.is_ready, "safety ready", PATIENCE_S)
        yield robot
