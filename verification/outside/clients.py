"""Plain Zenoh clients: an observer, a source of motion, an operator, and rogues."""

import itertools
import json
import random
import threading
import time
from collections import defaultdict
from types import TracebackType
from typing import Any, Self

import msgpack
import zenoh

from common import clock

ROOT = "t2/v1/001"
STATE, LINK = "tel/safety/state", "tel/bridge/link"
PERIOD_S = 0.05
KEPT = (
    "tel/bridge/bumper", "tel/bridge/ultrasonic", "tel/bridge/link", "tel/safety/*",
    "tel/odom/odometry", "tel/recorder/health", "evt/*", "@cmd/motion",
)  # fmt: skip
Map = dict[str, Any]


def session(endpoint: str, mode: str = "client") -> "zenoh.Session":
    """Open a session with the router; raises without one."""
    config = {
        "mode": mode,
        "connect": {"endpoints": [endpoint], "timeout_ms": 1500},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
    }
    return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))


def header(seq: int, boot: int) -> Map:
    """Return the header of every message."""
    now = {"t_ns": time.time_ns(), "mono_ns": clock.now_ns()}
    return {"seq": seq, "boot": boot, "host": 0, **now}


class Observer:
    """The newest message of each key, and the times at which a condition was met."""

    def __init__(self, session: "zenoh.Session") -> None:
        self.messages: dict[str, list[tuple[float, Map, int]]] = defaultdict(list)
        self._subscribers = [
            session.declare_subscriber(f"{ROOT}/{key}", self._on_sample) for key in KEPT
        ]

    def _on_sample(self, sample: "zenoh.Sample") -> None:
        payload = bytes(sample.payload)
        key = str(sample.key_expr).removeprefix(f"{ROOT}/")
        try:
            message = msgpack.unpackb(payload)
        except ValueError:
            return
        self.messages[key].append((time.monotonic(), message, len(payload)))

    def last(self, key: str) -> Map:
        """Return the newest message of a key; empty before the first one."""
        found = self.messages[key]
        return dict(found[-1][1]) if found else {}

    def since(self, key: str, at: float) -> list[Map]:
        """Return the messages of a key from a moment on."""
        return [message for when, message, _ in list(self.messages[key]) if when >= at]

    def causes(self, since: float) -> set[str]:
        """Return the names of all causes from a moment on."""
        states = self.since(STATE, since)
        return {cause["name"] for state in states for cause in state["causes"]}

    @property
    def latched(self) -> list[str]:
        return list(self.last(STATE).get("latched", ()))


class Source:
    """A source of motion requests at 20 Hz, with echo; silent until it requests."""

    def __init__(self, session: "zenoh.Session", observer: Observer, name: str) -> None:
        self._publisher = session.declare_publisher(
            f"{ROOT}/@cmd/drive/{name}",
            encoding="application/msgpack;t2.v1.Drive",
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.INTERACTIVE_HIGH,
            express=True,
        )
        self._observer = observer
        self._boot, self._seq = random.getrandbits(48), itertools.count(1)
        self._request: tuple[float, float] | None = None
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        self.silence()
        self._ended.set()
        self._thread.join()
        self._publisher.undeclare()

    def request(self, linear: float, angular: float = 0.0) -> None:
        """Request a motion from now on."""
        self._request = linear, angular

    def silence(self) -> None:
        """End the requests: three zeros, then nothing."""
        if self._request is not None:
            self._request = None
            for _ in range(3):
                self._put(0.0, 0.0)

    def _run(self) -> None:
        while not self._ended.wait(PERIOD_S):
            request = self._request
            if request is not None:
                self._put(*request)

    def _put(self, linear: float, angular: float) -> None:
        echo = self._observer.last(STATE).get("heartbeat", 0)
        body = {"linear": linear, "angular": angular, "echo": echo}
        self._publisher.put(msgpack.packb(header(next(self._seq), self._boot) | body))


class Operator:
    """Calls to safety: built from the state that was seen, sent now or later."""

    def __init__(self, session: "zenoh.Session", observer: Observer) -> None:
        self._session, self._observer = session, observer

    def reset_request(self) -> Map:
        """Return a reset of what is latched now."""
        state = self._observer.last(STATE)
        if "release" not in state:
            return {}
        latched = [c["id"] for c in state["causes"] if c["name"] in state["latched"]]
        return {"echo": state["heartbeat"], "causes": latched}

    def release_request(self, direction: str | None) -> Map:
        """Return one call of a held release."""
        state = self._observer.last(STATE)
        if "release" not in state:
            return {"held": True}
        chosen = {} if direction is None else {"direction": direction}
        return {"held": True, "echo": state["heartbeat"], **chosen}

    def call(self, name: str, request: Map, timeout: float = 2.0) -> tuple[bool, str]:
        """Make a call; return whether it was done, and the text of the answer."""
        payload = msgpack.packb(request)
        replies = self._session.get(f"{ROOT}/srv/{name}", payload=payload, timeout=timeout)
        for reply in replies:
            if reply.ok is not None:
                return True, str(msgpack.unpackb(bytes(reply.ok.payload)).get("text", ""))
            if reply.err is not None:
                return False, bytes(reply.err.payload).decode(errors="replace")
        return False, "no answer"

    def reset(self, patience: float = 4.0) -> bool:
        """Reset until nothing is latched, as an operator who tries again."""
        end = time.monotonic() + patience
        while self._observer.latched and time.monotonic() < end:
            self.call("safety/reset", self.reset_request())
            time.sleep(0.2)
        return not self._observer.latched

    def hold_release(self, direction: str | None, seconds: float) -> list[str]:
        """Hold release for so long, at 10 Hz; return the refusals."""
        end, refusals = time.monotonic() + seconds, []
        while time.monotonic() < end:
            done, text = self.call("safety/release", self.release_request(direction), 0.3)
            if not done:
                refusals.append(text)
            time.sleep(0.1)
        return refusals
