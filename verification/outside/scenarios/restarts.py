"""Restarts, a second start, and a full disk: groups 5, 10, 16 and 17."""

import os
import shutil
import signal
import tempfile
import time
from pathlib import Path

from verification.outside.clients import LINK, STATE
from verification.outside.stack import wait_for
from verification.outside.testbed import Result, Testbed, scenario, seconds

BACK_S = 12.0
STILL_S = 1.5


def restarted(bed: Testbed, name: str) -> str:
    """Kill one of the processes while the vehicle is driven, start it again, and drive."""
    process = bed.stack.processes[name]
    with bed.source() as source:
        bed.drive(source, 0.3)
        at = time.monotonic()
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        time.sleep(STILL_S)
        bed.stack.start(name)
        begin = time.monotonic()
        time.sleep(1.0)
        fresh = (STATE, LINK)
        back = wait_for(lambda: all(bed.observer.since(k, time.monotonic() - 0.5) for k in fresh),
                        BACK_S)  # fmt: skip
        # The source requests 0.3 m/s throughout: only a neutral request may let it drive again.
        time.sleep(1.0)
        runs = bed.runs(begin)
    if not back:
        return f"{name}: not back within {BACK_S:.0f} s"
    if runs:
        return f"{name}: {len(runs)} RUN without a neutral request, from {runs[0].at - at:.1f} s"
    bed.operator.reset()
    bed.arm(BACK_S)
    with bed.source() as source:
        bed.drive(source, 0.3)
        bed.halt(source)
    return ""


@scenario(
    5,
    "safety, bridge (with its guard) and router are killed at 0.3 m/s and started again, in turn",
    "no RUN from the request that goes on; after a neutral one the vehicle drives",
)
def restarts(bed: Testbed) -> Result:
    failures = []
    for name in ("safety", "bridge", "router"):
        failure = restarted(bed, name)
        if failure:
            failures.append(failure)
            break
    return Result("; ".join(failures) or "drives again each time", not failures)


@scenario(
    10,
    "`t2 up` is killed with -9 at 0.4 m/s",
    "BRAKE within 0.15 s, the vehicle stands within 0.3 s; no RUN after that",
    supervised=True,
)
def supervisor_killed(bed: Testbed) -> Result:
    with bed.source() as source:
        bed.drive(source, 0.4)
        at = time.monotonic()
        bed.stack.kill("up")
        brake = bed.first("brake", at, 2.0)
        stands = wait_for(lambda: not bed.board.vehicle.linear, 2.0)
        took = time.monotonic() - at if stands else None
        time.sleep(1.0)
    late = bed.runs(at + 0.15)
    text = f"BRAKE {seconds(brake)}, {len(late)} RUN later"
    ok = brake is not None and brake <= 0.15 and not late
    if brake is None or brake < 1.0:  # measured by a poll, after the wait for BRAKE
        text += f", stands after {seconds(took)}"
        ok = ok and took is not None and took <= 0.3
    return Result(text, ok)


@scenario(
    10,
    "the bridge's guard alone is killed with -9 at 0.4 m/s",
    "STOP or BRAKE within 0.15 s; no RUN after that",
)
def guard_killed(bed: Testbed) -> Result:
    with bed.source() as source:
        bed.drive(source, 0.4)
        at = time.monotonic()
        bed.stack.kill("bridge")
        time.sleep(2.0)
    runs = bed.runs(at)
    last = runs[-1].at - at if runs else 0.0
    text = f"last RUN after {seconds(last)}, {bed.board.commands[-1].kind} is held"
    still = abs(bed.speed()) < 0.02
    return Result(text + ("" if still else f", {bed.speed():.2f} m/s"), last <= 0.15 and still)


@scenario(
    17,
    "a second `t2 up` with the same ports beside the running stack",
    "it ends with an error within 10 s, and no second safety was on the bus",
)
def second_up(bed: Testbed) -> Result:
    at = time.monotonic()
    code, out = bed.stack.run("cli", "up", "--no-sim", timeout=10.0)
    time.sleep(0.5)
    boots = {state["boot"] for state in bed.observer.since(STATE, at)}
    line = out.strip().splitlines()[-1][-90:] if out.strip() else ""
    text = (
        f"{'runs on' if code is None else f'exit {code}'}, {len(boots)} safety on the bus: {line}"
    )
    return Result(text, code not in (None, 0) and len(boots) == 1)


@scenario(
    16,
    "less than recorder.free is free, four old recordings of 40 MB; a contact",
    "the incident is written; the newest and the one with a mark are left",
)
def full_disk(bed: Testbed) -> Result:
    memory = Path("/dev/shm")  # less written to by others than a disk
    folder = Path(tempfile.mkdtemp(dir=memory if memory.is_dir() else None))
    try:
        return incident(bed, folder)
    finally:
        shutil.rmtree(folder)


def incident(bed: Testbed, folder: Path) -> Result:
    old = [folder / f"001-2020010{day}-000000.mcap" for day in (1, 2, 3, 4)]
    for path in old:
        path.write_bytes(bytes(40_000_000))
    (folder / f"{old[0].name}.keep").touch()
    limit = shutil.disk_usage(folder).free / 1e6 + 20
    bed.stack.sets += [f"recorder.folder={folder}", f"recorder.free={limit:.0f}", "recorder.tail=1"]
    bed.stack.start("recorder")
    bed.wait(lambda: bed.observer.last("tel/recorder/health"), 10.0, "no recorder")
    time.sleep(2.0)
    bed.contact()
    found = wait_for(lambda: [*folder.glob("*-latch-*.mcap")], 5.0)
    left = [str(number) for number, path in enumerate(old, 1) if path.exists()]
    text = f"incident {'' if found else 'not '}written; old recordings left: {', '.join(left)}"
    return Result(text, found and {"1", "4"} <= set(left))
