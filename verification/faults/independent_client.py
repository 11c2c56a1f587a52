"""Plain Zenoh clients, written from ``docs/bus.md`` alone: they import nothing of the project.

``python -m verification.faults.independent_client ENDPOINT KEY`` is a source of robot 001 until its
standard input ends. A source of drive requests reads speeds in m/s from there, one a line; others
repeat an empty message.
"""

import contextlib
import itertools
import json
import random
import sys
import threading
import time
from typing import Any

import msgpack
import zenoh

ROOT = "t2/v1/001"
STATE, BUMPER, VELOCITY = "tel/safety/state", "tel/bridge/bumper", "tel/bridge/velocity"
MOTION, DRIVE = "@cmd/motion", "@cmd/drive/teleop"
PERIOD_S = 0.05
UP_MS = 60_000  # until the router listens
Map = dict[str, Any]


def session(endpoint: str, mode: str = "client") -> "zenoh.Session":
    """Open a session with the router."""
    retry = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5}
    config = {
        "mode": mode,
        "connect": {"endpoints": [endpoint], "timeout_ms": UP_MS, "retry": retry},
        "transport": {"link": {"tx": {"lease": 1000}}},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
    }
    return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))


class Client:
    """An operator's program: reads what the services publish, stops, calls."""

    def __init__(self, bus: "zenoh.Session", *keys: str) -> None:
        self.bus = bus
        self.newest: dict[str, bytes] = {}  # by key
        self._subscribers = [
            bus.declare_subscriber(f"{ROOT}/{key}", self._on_sample) for key in (STATE, *keys)
        ]

    def _on_sample(self, sample: "zenoh.Sample") -> None:
        payload = sample.payload.to_bytes()
        with contextlib.suppress(ValueError, TypeError):  # anybody may publish anything
            if isinstance(msgpack.unpackb(payload), dict):
                self.newest[str(sample.key_expr).removeprefix(f"{ROOT}/")] = payload

    def last(self, key: str) -> Map:
        """Return the newest message of a key; empty before the first one."""
        return dict(msgpack.unpackb(self.newest.get(key, b"\x80")))

    @property
    def state(self) -> Map:
        """The newest state of safety."""
        return self.last(STATE)

    @property
    def latched(self) -> list[str]:
        """The causes that need a reset."""
        return list(self.state.get("latched", ()))

    def put(self, key: str, payload: bytes = b"") -> float:
        """Publish on a key of the robot; return the time."""
        self.bus.put(f"{ROOT}/{key}", payload)
        return time.monotonic()

    def call(self, name: str, request: Map) -> None:
        """Make a call, and wait for the end of its answers."""
        list(self.bus.get(f"{ROOT}/srv/{name}", payload=msgpack.packb(request), timeout=2.0))

    def reset_request(self) -> Map:
        """Return a reset of all that is latched now."""
        state = self.state
        causes = [one["id"] for one in state["causes"] if one["name"] in state["latched"]]
        return {"echo": state["heartbeat"], "causes": causes}

    def reset(self) -> bool:
        """Reset until nothing is latched, as an operator who tries again."""
        for _ in range(20):
            if not self.latched:
                return True
            self.call("safety/reset", self.reset_request())
            time.sleep(0.2)
        return False


class Source:
    """A program that repeats a message with header and echo at 20 Hz, once it has content."""

    def __init__(self, client: Client, key: str) -> None:
        self.key = key
        self._client = client
        self._boot, self._seq = random.getrandbits(48), itertools.count(1)
        self._content: Map | None = None
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the messages."""
        self._ended.set()
        self._thread.join()

    def repeat(self, **content: object) -> None:
        """Repeat a message with these fields from now on."""
        self._content = content

    def silence(self) -> float:
        """End the messages; return the time."""
        self._content = None
        return time.monotonic()

    def put(self, **content: object) -> bytes:
        """Publish one message; the fields replace header and echo, too."""
        echo = self._client.state.get("heartbeat", 0)
        message = {"seq": next(self._seq), "boot": self._boot, "echo": echo, **content}
        payload: bytes = msgpack.packb(message)
        self._client.put(self.key, payload)
        return payload

    def _run(self) -> None:
        while not self._ended.wait(PERIOD_S):
            content = self._content
            if content is not None:
                self.put(**content)


def main() -> None:
    """Run a source."""
    endpoint, key = sys.argv[1:]
    with session(endpoint) as bus, contextlib.closing(Source(Client(bus), key)) as source:
        if "/drive/" not in key:
            source.repeat()
        for line in sys.stdin:
            source.repeat(linear=float(line), angular=0.0)


if __name__ == "__main__":
    main()
