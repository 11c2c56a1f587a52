"""Contact and release: groups 1 and 3."""

import time
from typing import Any

from verification.outside import wire
from verification.outside.board import Faults
from verification.outside.testbed import Result, Testbed, scenario
from verification.outside.wire import Command

TRAVEL_M = 0.15 + 0.03  # released per latch, and the way to stop


def counts(runs: list[Command]) -> str:
    forward = sum(c.linear > 0 for c in runs)
    return f"{forward} RUN forward, {len(runs) - forward} backward"


@scenario(
    1,
    "hit at 0.3 m/s with two rebound samples of -0.05 m/s; release backward",
    "no RUN forward, RUN backward at 0.1 m/s at most",
)
def rebound(bed: Testbed) -> Result:
    with bed.source() as source:
        bed.drive(source, 0.3)
        bed.board.vehicle.linear = 0.0
        bed.board.reported = [(-0.05, 0.0)] * 2
        time.sleep(0.045)
        at = bed.contact()
        source.silence()
    time.sleep(0.5)
    bed.operator.hold_release("backward", 1.5)
    runs = bed.runs(at + 0.1)
    back = [c.linear for c in runs if c.linear < 0]
    ok = not [c for c in runs if c.linear > 0] and bool(back) and min(back) >= -0.101
    return Result(counts(runs), ok)


@scenario(
    1,
    "release backward; free for 0.1 s, then pressed again, held on for 2 s",
    "no RUN in any direction after the second press but what was under way",
)
def pressed_again(bed: Testbed) -> Result:
    with bed.source() as source:
        bed.drive(source, 0.3)
        at = bed.contact()
        source.silence()
    time.sleep(1.0)
    bed.operator.hold_release("backward", 0.6)
    bed.board.bumper = 0
    bed.operator.hold_release("backward", 0.1)
    bed.board.bumper = 1
    again = time.monotonic()
    moved = bed.board.vehicle.travelled
    bed.operator.hold_release("backward", 2.0)
    late = bed.runs(again + 0.15)
    moved = bed.board.vehicle.travelled - moved
    if not bed.runs(at + 0.5):
        return Result("release backward moves nothing", ok=False)
    return Result(f"{counts(late)}; {moved * 100:.0f} cm", not late)


@scenario(
    1,
    "one latch, released backward and forward for 4 s each",
    f"at most {TRAVEL_M * 100:.0f} cm of travel in all",
)
def travel_per_latch(bed: Testbed) -> Result:
    with bed.source() as source:
        bed.drive(source, 0.3)
        bed.contact()
        source.silence()
    time.sleep(1.0)
    begin = bed.board.vehicle.travelled
    bed.operator.hold_release("backward", 4.0)
    bed.board.bumper = 0
    time.sleep(0.2)
    bed.board.bumper = 1
    time.sleep(0.2)
    bed.operator.hold_release("forward", 3.0)
    travelled = bed.board.vehicle.travelled - begin
    return Result(f"{travelled * 100:.0f} cm", 0.01 < travelled <= TRAVEL_M)


@scenario(
    1,
    "released backward for 5 s while the counters do not answer",
    f"at most {TRAVEL_M * 100:.0f} cm of travel",
)
def travel_without_counters(bed: Testbed) -> Result:
    return uncounted(bed, Faults(drop=(wire.DISTANCE,)))


@scenario(
    1,
    "released backward for 5 s while the velocity reads 0.1 m/s too much",
    f"at most {TRAVEL_M * 100:.0f} cm of travel",
)
def travel_with_bias(bed: Testbed) -> Result:
    return uncounted(bed, Faults(bias=(0.1, 0.0)))


def uncounted(bed: Testbed, faults: Faults) -> Result:
    with bed.source() as source:
        bed.drive(source, 0.3)
        bed.contact()
        source.silence()
    time.sleep(1.0)
    bed.board.faults = faults
    begin = bed.board.vehicle.travelled
    bed.operator.hold_release("backward", 5.0)
    travelled = bed.board.vehicle.travelled - begin
    return Result(f"{travelled * 100:.0f} cm", travelled <= TRAVEL_M)


@scenario(
    1,
    "driven forward, standing for 4 s, touched from behind; release without a direction",
    "no RUN without a direction; forward, as the operator chooses, moves forward only",
)
def touched_from_behind(bed: Testbed) -> Result:
    with bed.source() as source:
        bed.drive(source, 0.3)
        bed.halt(source)
    time.sleep(4.0)
    at = bed.contact(seconds=0.5)
    bed.operator.hold_release(None, 1.5)
    time.sleep(0.5)
    blind, chosen_at = bed.runs(at), time.monotonic()
    bed.operator.hold_release("forward", 1.5)
    chosen = bed.runs(chosen_at)
    ok = not blind and bool(chosen) and all(c.linear > 0 for c in chosen)
    return Result(f"without: {counts(blind)}; forward chosen: {counts(chosen)}", ok)


@scenario(
    3,
    "every third answer is lost; 18 presses of 60 ms",
    "12 presses on the bus; during the others the losses slow or stop the vehicle; queries at 45/s",
    faults=lambda: Faults(drop_every=3),
    armed=False,
)
def lost_answers(bed: Testbed) -> Result:
    bed.wait(lambda: bed.observer.last("tel/bridge/bumper"), 5.0, "no bumper sample")
    time.sleep(2.0)
    begin, seen, slowed = time.monotonic(), 0, 0
    for _ in range(18):
        at = time.monotonic()
        bed.board.bumper = 1
        time.sleep(0.06)
        bed.board.bumper = 0
        time.sleep(0.25)
        if any(m["pressed"] for m in bed.observer.since("tel/bridge/bumper", at)):
            seen += 1
        else:
            states = bed.observer.since("tel/safety/state", at)
            slowed += bool(states) and all(names_losses(state) for state in states)
    rate = bed.board.queries(wire.BUMPER, begin) / (time.monotonic() - begin)
    text = f"{seen} of 18 seen, {slowed} more while slowed or stopped for it; {rate:.0f} queries/s"
    return Result(text, seen >= 12 and seen + slowed == 18 and rate >= 45)


def names_losses(state: dict[str, Any]) -> bool:
    """Return whether safety slows or stops the vehicle because bumper samples are lost."""
    return any(cause["name"] in ("bumper", "bumper_lossy") for cause in state["causes"])


@scenario(
    3,
    "bumper bytes 2, 0x80 and 0xFF, each for 0.3 s",
    "each latches a contact",
)
def bumper_bytes(bed: Testbed) -> Result:
    latched = []
    for byte in (0x02, 0x80, 0xFF):
        bed.board.bumper = byte
        time.sleep(0.3)
        if "contact" in bed.observer.latched:
            latched.append(f"{byte:#04x}")
        bed.board.bumper = 0
        time.sleep(0.3)
        bed.operator.reset()
    return Result(f"latched by {', '.join(latched) or 'none'}", len(latched) == 3)


@scenario(
    3,
    "every second answer about the bumper is lost from 0.3 m/s on",
    "no RUN later than 0.5 s: more than three polls lost within 0.2 s stop the vehicle",
)
def half_lost(bed: Testbed) -> Result:
    with bed.source() as source:
        bed.drive(source, 0.3)
        at = time.monotonic()
        bed.board.faults.drop_bumper = 2
        time.sleep(2.0)
    late = bed.runs(at + 0.5)
    causes = bed.observer.causes(at) - {"no_request"}
    return Result(f"{len(late)} RUN later; causes {', '.join(sorted(causes)) or 'none'}", not late)
