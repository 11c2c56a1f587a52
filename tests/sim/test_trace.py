"""The trace of a simulation: its contents, and equality for equal seeds."""

import msgspec

from common.wire import commands as c
from sim import trace as t
from sim.requests import Asked, PowerCycle, Wire
from tests.sim.sim_fixture import WALL_AHEAD, SimFixture, model, room


def test_the_trace_knows_when_the_first_frame_said_so() -> None:
    sim = SimFixture(WALL_AHEAD)
    sim.run(1.0)
    sim.after(4.0)
    sim.do(Wire(drop=1.0))
    sim.say(c.BumperQuery())  # this answer does not arrive
    sim.do(Wire())
    assert sim.of(t.BumperSent) == []
    for linear in (0.0, -0.5):
        sim.say(c.BumperQuery())
        sim.say(c.BumperQuery())
        sim.run(linear)
        sim.after(1.0)
    sim.say(c.BumperQuery())
    assert [line.pressed for line in sim.of(t.BumperSent)] == [True, False]


LAP = (
    (0.8, 0.0, 1.0), (0.0, 1.0, 1.0), (0.6, 0.4, 1.0), (-0.3, -0.5, 2.0), (1.2, 0.1, 2.0),
)  # fmt: skip
LOSSY = Wire(drop=0.1, duplicate=0.1, reorder=0.1, corrupt=0.1, delay=0.02)
REQUESTS: tuple[Asked, ...] = Wire(), LOSSY, LOSSY, PowerCycle(), LOSSY


def lap(seed: int) -> tuple[bytes, bytes]:
    """Drive around a noisy room on a bad cable; return the trace and all bytes for the PC."""
    boxes = ({"name": "step", "x": 2.0, "y": 1.0, "length": 0.4, "width": 0.4, "low": True},)
    walls = [{"points": [[-2, -2], [4, -2], [4, 3], [-2, 3], [-2, -2]]}]
    sim = SimFixture(room(*boxes, walls=walls), model(sonar={"noise": 0.01}), seed)
    for (linear, angular, seconds), request in zip(LAP, REQUESTS, strict=True):
        sim.do(request)
        for _ in range(round(seconds * 10)):
            sim.run(linear, angular)
            sim.say(c.UltrasonicQuery(), c.BumperQuery())
            sim.after(0.1)
    trace = b"\n".join(msgspec.json.encode(line) for line in sim.records)
    return trace, b"".join(datagram.payload for datagram in sim.datagrams)


def test_the_same_seed_gives_the_same_trace_and_the_same_bytes() -> None:
    first = lap(1)
    assert first == lap(1)
    assert first[1] != lap(2)[1]


def test_an_incomplete_last_line_is_ignored() -> None:
    line = msgspec.json.encode(t.BumperSent(mono_ns=1, pressed=True)) + b"\n"
    assert t.read(line + b'{"event":"tru') == [t.BumperSent(mono_ns=1, pressed=True)]
