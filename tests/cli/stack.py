"""``t2 up`` in tests: its processes, settings that suit tests, and who has started."""

import json
import socket
from pathlib import Path

from verification.harness.ports import free_port

STACK = {"router", "sim", "bridge", "safety", "odom", "recorder"}


def ports() -> list[str]:
    """Return settings with ports that were free a moment ago."""
    board, first, second = (free_port(socket.SOCK_DGRAM) for _ in range(3))
    return [
        f"board.port={board}",
        f"board.listen_ports={first},{second}",
        f"bus.listen=tcp/127.0.0.1:{free_port()}",
        # These machines hold processes up: no bridge and no router is to be killed for it here.
        "bridge.unsafe_overrides=heartbeat",
        "bridge.heartbeat=5",
        "bus.probe_deadline=30",
    ]


def starts(log: Path, name: str) -> int:
    """Return how often a service has said that it has started."""
    # Up to the last whole line; six processes write here, and none into the other's line.
    lines = [json.loads(line) for line in log.read_text(encoding="utf-8").split("\n")[:-1]]
    return sum(line["service"] == name and line["event"] == "started" for line in lines)
