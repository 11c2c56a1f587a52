"""``t2 up`` in tests: its processes, settings for tests, and started services."""

import json
import socket
from pathlib import Path

from verification.harness.ports import free_port

STACK = {
    "router", "sim", "bridge", "safety", "odom", "localization", "patrol", "recorder", "camera",
}  # fmt: skip


def ports() -> list[str]:
    """Return settings with free ports."""
    board, first, second = (free_port(socket.SOCK_DGRAM) for _ in range(3))
    return [
        f"board.port={board}",
        f"board.listen_ports={first},{second}",
        f"bus.listen=tcp/127.0.0.1:{free_port()}",
        # Scheduling stalls of test hosts must not kill bridge or router.
        "unsafe_overrides=host.stall",
        "host.stall=1",
        "bus.probe_deadline=30",
    ]


def starts(log: Path, name: str) -> int:
    """Return how often a service has logged its start."""
    # Without an incomplete last line; the lines of six processes are not interleaved.
    lines = [json.loads(line) for line in log.read_text(encoding="utf-8").split("\n")[:-1]]
    return sum(line["service"] == name and line["event"] == "started" for line in lines)
