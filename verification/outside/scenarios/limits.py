"""Speed limits by third parties: groups 17 and 18."""

import itertools
import math
import random
import time

import msgpack
import zenoh

from verification.outside.clients import ROOT, STATE, Map, header
from verification.outside.testbed import Result, Testbed, scenario

LIDAR = 'safety.limits.lidar={lease = 0.5, silence = "ignore"}'
NEEDED = 'safety.limits.lidar={lease = 0.5, silence = "stop"}'
PERIOD_S = 0.05


class Limiter:
    """A source of speed limits with plain Zenoh."""

    def __init__(self, bed: Testbed, name: str = "lidar") -> None:
        self.key = f"{ROOT}/@cmd/limit/{name}"
        self._bed = bed
        self.boot, self.seq = random.getrandbits(48), itertools.count(1)
        self.sent: list[bytes] = []

    def put(self, **fields: object) -> None:
        """Put one limit; fields replace those of a good one."""
        echo = self._bed.observer.last(STATE).get("heartbeat", 0)
        body: Map = {**header(next(self.seq), self.boot), "echo": echo, **fields}
        self.sent.append(msgpack.packb(body))
        self.raw(self.sent[-1])

    def raw(self, payload: bytes) -> None:
        self._bed.bus.put(self.key, payload, congestion_control=zenoh.CongestionControl.DROP)

    def repeat(self, seconds: float, **fields: object) -> None:
        """Put a limit for a while."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.put(**fields)
            time.sleep(PERIOD_S)


def fastest(bed: Testbed, since: float) -> float:
    """Return the fastest linear speed that the board was commanded, in m/s."""
    return max((abs(command.linear) for command in bed.runs(since)), default=0.0)


@scenario(
    17,
    "0.8 m/s is driven; a third party caps the speed at 0.3 m/s, then at 5 m/s",
    "0.3 m/s after the normal deceleration, cause `limit` with the reason; never over 0.8 m/s",
    sets=[LIDAR],
)
def cap(bed: Testbed) -> Result:
    limiter = Limiter(bed)
    with bed.source() as source:
        bed.drive(source, 0.8)
        at = time.monotonic()
        limiter.repeat(1.5, linear=0.3, reason="person at 2 m")
        slow = fastest(bed, at + 1.1)
        causes = {one["name"]: one["text"] for one in bed.observer.last(STATE)["causes"]}
        limiter.repeat(2.5, linear=5.0)
        fast = fastest(bed, at)
    text = causes.get("limit", "no cause")
    ok = 0.29 < slow < 0.301 and fast < 0.801 and "lidar: person at 2 m" in text
    return Result(f"{slow:.3f} m/s, then {fast:.3f} m/s; {text!r}", ok)


def forged(echo: int) -> list[Map]:
    """Return limits that safety must refuse: each would lift a stop if it counted."""
    return [
        {"linear": math.nan},
        {"linear": math.inf},
        {"linear": -1.0},
        {"linear": "fast"},
        {"linear": True},
        {"echo": echo - 100},
        {"echo": echo + 100_000},
        {"echo": None},
        {"seq": 1},
        {"boot": 4711, "seq": 1},
        {"reason": "x" * 5000},
        {"reason": 7},
    ]


@scenario(
    17,
    "a protective stop is repeated; between, 12 forged or late limits without a cap, and a replay",
    "no RUN that moves while the stop is repeated, nor after it with the stick held",
    sets=[LIDAR],
)
def lifted_by_forgery(bed: Testbed) -> Result:
    limiter = Limiter(bed)
    with bed.source() as source:
        bed.drive(source, 0.4)
        limiter.repeat(0.3)
        old = list(limiter.sent)
        limiter.repeat(0.2, linear=0.0, reason="person")
        at = time.monotonic()
        for fields in forged(bed.observer.last(STATE)["heartbeat"]) * 3:
            limiter.put(linear=0.0)
            limiter.put(**fields)
            for payload in old:
                limiter.raw(payload)
            time.sleep(PERIOD_S)
        runs = bed.runs(at)
        limiter.repeat(1.0)
        held = bed.runs(at)
        source.request(0.0)
        limiter.repeat(1.5)
        source.request(0.4)
        again = time.monotonic()
        limiter.repeat(1.0)
        drives = bool(bed.runs(again))
    text = f"{len(runs)} RUN, {len(held)} with the stick held, drives after neutral: {drives}"
    return Result(text, not runs and not held and drives)


@scenario(
    17,
    "sources that are not in the settings stop the robot: one name, 3000 names, wildcards",
    "no effect; refused and counted; safety's health message stays under 16 kB",
    sets=[LIDAR],
)
def unknown_limits(bed: Testbed) -> Result:
    with bed.source() as source:
        bed.drive(source, 0.4)
        at = time.monotonic()
        for name in ("person", "*", "li$*", "lidar/x", "**"):
            Limiter(bed, name).repeat(0.2, linear=0.0)
        for number in range(3000):
            bed.bus.put(f"{ROOT}/@cmd/limit/x{number}", b"\x80")
            if number % 50 == 0:
                time.sleep(0.02)
        time.sleep(1.5)
        slowest = min((c.linear for c in bed.board.since(at) if c.kind == "run"), default=0.0)
    health = bed.observer.messages["tel/safety/health"]
    size = max((size for _, _, size in health), default=0)
    counters = bed.observer.last("tel/safety/health").get("counters", {})
    counted = counters.get("refused_limit_unknown_source", 0)
    text = f"slowest {slowest:.2f} m/s, {counted} refused, {size / 1000:.1f} kB"
    return Result(text, slowest > 0.39 and counted > 0 and 0 < size < 16_000)


@scenario(
    17,
    "two programs limit under one name, 0.2 and 5 m/s",
    "STOP until one is left; then a neutral request, and the cap of the one that is left",
    sets=[LIDAR],
)
def two_limiters(bed: Testbed) -> Result:
    one, other = Limiter(bed), Limiter(bed)
    with bed.source() as source:
        bed.drive(source, 0.4)
        one.repeat(0.3, linear=0.2)
        other.put(linear=5.0)
        time.sleep(0.1)
        at = time.monotonic()
        for _ in range(20):
            one.put(linear=0.2)
            other.put(linear=5.0)
            time.sleep(PERIOD_S)
        one.repeat(1.5, linear=0.2)
        runs = bed.runs(at)
        source.request(0.0)
        one.repeat(0.3, linear=0.2)
        source.request(0.4)
        one.repeat(1.5, linear=0.2)
        after = fastest(bed, at)
    measured = f"{len(runs)} RUN, after a neutral request {after:.2f} m/s"
    return Result(measured, not runs and 0.05 < after < 0.201)


@scenario(
    18,
    "a source with `silence = stop` is not there, then comes, sends late messages, and ends",
    "no RUN without it; STOP 0.5 s after its last good limit; a neutral request each time",
    sets=[NEEDED],
)
def silent_limiter(bed: Testbed) -> Result:
    limiter = Limiter(bed)
    at = time.monotonic()
    with bed.source() as source:
        source.request(0.4)
        time.sleep(1.0)
        before = bed.runs(at)
        source.request(0.0)
        limiter.repeat(1.0)
        source.request(0.4)
        limiter.repeat(1.5)
        drove = bed.speed()
        late = time.monotonic()
        echo = bed.observer.last(STATE)["heartbeat"]
        while time.monotonic() < late + 2.0:  # as a proxy that holds everything
            limiter.put(echo=echo)
            time.sleep(PERIOD_S)
        runs = [command.at - late for command in bed.runs(late)]
        last = max(runs, default=0.0)
        limiter.repeat(1.0)
        held = bed.runs(late + 1.5)
    text = f"{len(before)} RUN before, {drove:.2f} m/s, last RUN after {last:.2f} s"
    ok = not before and drove > 0.35 and last < 0.4 + 0.5 + 0.1 and not held
    return Result(f"{text}, {len(held)} with the stick held", ok)
