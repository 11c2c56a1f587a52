"""An emergency stop that must be kept alive: group 19."""

import itertools
import random
import time

import msgpack

from verification.outside.clients import ROOT, STATE, Map, header
from verification.outside.testbed import Result, Testbed, scenario

PENDANT = 'safety.estop_keepalive=["pendant"]'
PERIOD_S = 0.1


class Pendant:
    """A pendant with plain Zenoh."""

    def __init__(self, bed: Testbed, name: str = "pendant") -> None:
        self.key = f"{ROOT}/@cmd/estop_keepalive/{name}"
        self._bed = bed
        self.boot, self.seq = random.getrandbits(48), itertools.count(1)

    def put(self, **fields: object) -> bytes:
        """Put one message; fields replace those of a good one."""
        echo = self._bed.observer.last(STATE).get("heartbeat", 0)
        body: Map = {**header(next(self.seq), self.boot), "echo": echo, **fields}
        payload: bytes = msgpack.packb(body)
        self._bed.bus.put(self.key, payload)
        return payload

    def repeat(self, seconds: float, **fields: object) -> list[bytes]:
        """Put messages for a while and return them."""
        end, sent = time.monotonic() + seconds, []
        while time.monotonic() < end:
            sent.append(self.put(**fields))
            time.sleep(PERIOD_S)
        return sent


@scenario(
    19,
    "0.4 m/s is requested without the pendant; it comes and goes; 14 forgeries, a replay",
    "no RUN without it; BRAKE latched at most 1.1 s after it ended; no forgery keeps it alive",
    sets=[PENDANT],
    armed=False,  # without the pendant safety inhibits
)
def lost_pendant(bed: Testbed) -> Result:
    pendant, at = Pendant(bed), time.monotonic()
    bed.wait(lambda: bed.observer.last(STATE).get("verdict"), 5.0, "no safety")
    with bed.source() as source:
        source.request(0.4)
        time.sleep(1.0)
        before = bed.runs(at)
        source.request(0.0)
        sent = pendant.repeat(1.5)
        source.request(0.4)
        sent += pendant.repeat(1.5)
        drove, echo = bed.speed(), bed.observer.last(STATE)["heartbeat"]
        ended = time.monotonic()
        forgeries: list[Map] = [
            {"seq": 1}, {"seq": 2}, {"echo": echo - 60}, {"echo": echo + 10_000}, {"echo": None},
            {"echo": "1"}, {"boot": "x"},
        ]  # fmt: skip
        for fields in forgeries * 2:
            pendant.put(**fields)
            bed.bus.put(pendant.key, random.choice(sent))
            Pendant(bed, "other").put()
            Pendant(bed, "*").put()
            time.sleep(PERIOD_S)
        last = max((command.at - ended for command in bed.runs(ended)), default=0.0)
        latched = "estop_keepalive" in bed.observer.latched
    text = f"{len(before)} RUN before, {drove:.2f} m/s, last RUN after {last:.2f} s"
    ok = not before and drove > 0.35 and 0.5 < last < 1.1 and latched
    return Result(f"{text}, latched: {latched}", ok)


@scenario(
    19,
    "a proxy holds all messages of the pendant for 3 s; then a second program uses its name",
    "BRAKE latched each time",
    sets=[PENDANT],
    armed=False,  # without the pendant safety inhibits
)
def held_pendant(bed: Testbed) -> Result:
    pendant = Pendant(bed)
    bed.wait(lambda: bed.observer.last(STATE).get("verdict"), 5.0, "no safety")
    with bed.source() as source:
        source.request(0.0)
        pendant.repeat(1.5)
        source.request(0.4)
        pendant.repeat(1.0)
        held, echo = time.monotonic(), bed.observer.last(STATE)["heartbeat"]
        pendant.repeat(3.0, echo=echo)
        last = max((command.at - held for command in bed.runs(held)), default=0.0)
        first = "estop_keepalive" in bed.observer.latched
        source.request(0.0)
        pendant.repeat(2.0)
        reset = bed.operator.reset()
        pendant.repeat(1.0)
        source.request(0.4)
        pendant.repeat(1.0)
        drove, rival = bed.speed(), time.monotonic()
        Pendant(bed).put()
        pendant.repeat(0.5)
        second = bed.first("brake", rival, 0.5)
    text = f"last RUN after {last:.2f} s, reset: {reset}, {drove:.2f} m/s"
    ok = first and last < 1.1 and bool(reset) and drove > 0.3 and second is not None
    return Result(f"{text}, BRAKE after {second}", ok)
