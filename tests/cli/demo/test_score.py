"""Results of artificial traces: measured values, and the condition of a good lap."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pytest

from cli.demo.score import Trace, good, read, results
from common import motion
from common.freshness import NS_PER_S
from sim import trace as t

RUN, STOP, BRAKE = motion.Command
TICK_NS = NS_PER_S // 20  # the simulator records the truth at 20 Hz


def truth(tick: int, **fields: Any) -> t.Truth:
    """Return the truth at a tick: standing at the start with 1 m clearance."""
    known: dict[str, Any] = dict.fromkeys(
        ("x", "y", "heading", "linear", "angular", "distance"), 0.0
    )
    known |= {
        "clearance": 1.0,
        "contact": False,
        "pressed": False,
        "command": command(0, STOP),
        "braking": False,
        "ultrasonic_brake": True,
        "bumper_brake": True,
        "silent": False,
    }
    return t.Truth(mono_ns=tick * TICK_NS, **(known | fields))


def command(at_ns: int, kind: motion.Command, linear: float = 0.0) -> t.Command:
    """Return a command that the board accepted."""
    return t.Command(mono_ns=at_ns, kind=kind, linear=linear, angular=0.0)


def hit_lap(stands: bool = True, brakes: bool = True) -> Trace:
    """Return 2 m at 0.8 m/s, a hit at tick 50, BRAKE 20 ms later, standstill after 4 cm."""
    hit_ns = 50 * TICK_NS
    driving = [truth(n, x=n * 0.04, distance=n * 0.04, linear=0.8) for n in range(51)]
    still = [truth(51 + n, x=2.04, distance=2.04, linear=0.0, contact=True) for n in range(40)]
    on = [truth(51 + n, x=2.0 + n * 0.04, distance=2.0 + n * 0.04, linear=0.8) for n in range(40)]
    commands = [
        command(0, RUN, 0.8),
        *([command(hit_ns + NS_PER_S // 50, BRAKE)] if brakes else []),
    ]
    bumper = [
        t.BumperSent(mono_ns=0, pressed=False),
        t.BumperSent(mono_ns=hit_ns, pressed=True),
    ]
    return Trace(driving + (still if stands else on), commands, bumper)


def back(trace: Trace, x: float = 0.0) -> Trace:
    """Return a trace that ends at the start."""
    return replace(trace, truth=[*trace.truth, truth(91, x=x, distance=4.0)])


NEAR = [truth(0, clearance=None), truth(1, clearance=0.05)]


@pytest.mark.parametrize(
    ("trace", "wrong"),
    [
        (back(hit_lap()), set()),
        (back(hit_lap(brakes=False)), {"contact 1: frame to BRAKE frame"}),
        (
            hit_lap(stands=False),
            {"contact 1: stopped within", "distance from the start at the end"},
        ),
        (replace(hit_lap(), truth=NEAR), {"closest to an obstacle", "contact 1: stopped within"}),
        (back(hit_lap(), x=0.26), {"distance from the start at the end"}),
    ],
)  # fmt: skip
def test_results_of_a_lap(trace: Trace, wrong: set[str]) -> None:
    rows = results(trace)
    assert {what for what, _, fine in rows if not fine} == wrong
    assert good(rows) is not bool(wrong)
    if not wrong:
        assert {what: amount for what, amount, _ in rows} == {
            "closest to an obstacle": "1.00 m",
            "distance from the start at the end": "0.0 cm",
            "contact 1: frame to BRAKE frame": "20.0 ms",
            "contact 1: stopped within": "4.0 cm",
        }
    assert not good(results(replace(trace, bumper=[])))  # no contact


def test_a_trace_is_read_up_to_the_last_whole_line(tmp_path: Path) -> None:
    trace = hit_lap()
    file = tmp_path / "trace.jsonl"
    lines = [*trace.truth, *trace.commands, *trace.bumper]
    encoded = b"".join(msgspec.json.encode(line) + b"\n" for line in lines)
    file.write_bytes(encoded + b'{"event":"tru')
    again = read(file)
    assert (again.truth, again.commands, again.bumper) == (
        trace.truth, trace.commands, trace.bumper,
    )  # fmt: skip
