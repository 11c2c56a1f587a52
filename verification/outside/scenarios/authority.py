"""Motion authority: groups 5 and 6."""

import itertools
import os
import signal
import threading
import time

import msgpack
import zenoh

from common import clock
from verification.outside.clients import ROOT, Map, header, session
from verification.outside.testbed import Result, Testbed, scenario, seconds

MOTION = f"{ROOT}/@cmd/motion"
ENCODING = "application/msgpack;t2.v1.Motion"


def forged(bed: Testbed, **fields: object) -> Map:
    """Return a motion message as safety would send it next, but for these fields."""
    seen = bed.observer.last("@cmd/motion")
    if not seen:
        return {**header(1, 1), "command": "run", "linear": 0.9, "angular": 0.0, **fields}
    return {**seen, "seq": seen["seq"] + 10_000, "command": "run", "linear": 0.9, **fields}


def rogue(bed: Testbed, times: int, bus: "zenoh.Session | None" = None, **fields: object) -> None:
    """Publish forged motion messages at 50 Hz."""
    message = forged(bed, **fields)
    for number in range(times):
        judged = bed.observer.last("tel/bridge/bumper").get("seq", 0)
        message |= {"seq": message["seq"] + 1, "judged": judged}
        message["t_ns"], message["mono_ns"] = time.time_ns(), clock.now_ns()
        (bus or bed.bus).put(MOTION, msgpack.packb(message), encoding=ENCODING)
        if number < times - 1:
            time.sleep(0.02)


@scenario(
    5,
    "a client publishes RUN 0.9 m/s with safety's boot and higher seq for 1 s",
    "no RUN",
)
def forged_motion(bed: Testbed) -> Result:
    time.sleep(0.5)
    at = time.monotonic()
    rogue(bed, 50)
    runs = bed.runs(at)
    fastest = max((c.linear for c in runs), default=0.0)
    return Result(f"{len(runs)} RUN, up to {fastest * 1000:.0f} mm/s", not runs)


@scenario(5, "the same from a session in mode peer, and from a second router", "no RUN")
def forged_motion_modes(bed: Testbed) -> Result:
    counts = []
    for mode in ("peer", "router"):
        with session(bed.stack.endpoint, mode) as bus:
            time.sleep(1.0)
            at = time.monotonic()
            rogue(bed, 50, bus)
            counts.append(len(bed.runs(at)))
    return Result(f"{counts[0]} RUN from a peer, {counts[1]} from a router", not any(counts))


@scenario(5, "the same with the bumper pressed, and after an e-stop", "no RUN")
def forged_motion_latched(bed: Testbed) -> Result:
    bed.contact(seconds=0.3)
    bed.bus.put(f"{ROOT}/estop", b"")
    bed.wait(lambda: "estop" in bed.observer.latched, 2.0, "no e-stop is latched")
    at = time.monotonic()
    rogue(bed, 50, latched=False)
    runs = bed.runs(at)
    return Result(f"{len(runs)} RUN", not runs)


@scenario(
    5,
    "one forged motion message with seq 2^62; then an e-stop",
    "BRAKE within 0.3 s of the e-stop",
)
def sequence_jump(bed: Testbed) -> Result:
    time.sleep(0.5)
    rogue(bed, 1, seq=2**62, command="stop", linear=0.0)
    time.sleep(0.5)
    at = time.monotonic()
    bed.bus.put(f"{ROOT}/estop", b"")
    brake = bed.first("brake", at, 3.0)
    return Result(f"BRAKE {seconds(brake)}", brake is not None and brake <= 0.3)


@scenario(
    5,
    "forged STOP messages at 50 Hz while teleop drives at 0.3 m/s",
    "the vehicle drives on",
)
def forged_stop(bed: Testbed) -> Result:
    with bed.source() as source:
        bed.drive(source, 0.3)
        rogue(bed, 75, command="stop", linear=0.0)
        slowest = bed.speed()
    return Result(f"{slowest:.2f} m/s after 1.5 s", slowest > 0.25)


def forge(bed: Testbed, key: str, ended: threading.Event, fields: Map) -> None:
    """Publish messages as the bridge's own at 100 Hz, with its boot and a higher seq."""
    seen = bed.observer.last(key)
    encoding = f"application/msgpack;t2.v1.{key.rpartition('/')[2].capitalize()}"
    for number in itertools.count(100_000):
        message = {**seen, **fields, "seq": seen["seq"] + number, "mono_ns": clock.now_ns()}
        bed.bus.put(f"{ROOT}/{key}", msgpack.packb(message), encoding=encoding)
        if ended.wait(0.01):
            return


@scenario(
    5,
    "forged clear bumper samples with the bridge's boot and higher seq; a hit at 0.3 m/s",
    "BRAKE within 0.1 s, the contact is latched, no RUN later than 0.15 s",
)
def forged_bumper(bed: Testbed) -> Result:
    ended = threading.Event()
    with bed.source() as source:
        bed.drive(source, 0.3)
        words = bed, "tel/bridge/bumper", ended, {"pressed": False}
        thread = threading.Thread(target=forge, args=words)
        thread.start()
        time.sleep(0.3)
        at = time.monotonic()
        bed.board.bumper = 1
        brake = bed.first("brake", at, 1.0)
        time.sleep(1.5)
        ended.set()
        thread.join()
    late = bed.runs(at + 0.15)
    latched = "contact" in bed.observer.latched
    text = f"BRAKE {seconds(brake)}, {len(late)} RUN later, {'' if latched else 'not '}latched"
    return Result(text, brake is not None and brake <= 0.1 and latched and not late)


@scenario(
    5,
    "forged clear sonars with the bridge's boot and higher seq; the front is at 0.15 m",
    "no RUN forward at a request of 0.3 m/s",
)
def forged_sonar(bed: Testbed) -> Result:
    bed.board.sonars[1:4] = [150] * 3
    time.sleep(0.5)
    ended = threading.Event()
    fields = {"ranges": [None] * 8, "status": ["no_echo"] * 8}
    thread = threading.Thread(target=forge, args=(bed, "tel/bridge/ultrasonic", ended, fields))
    thread.start()
    at = time.monotonic()
    with bed.source() as source:
        source.request(0.3)
        time.sleep(2.0)
    ended.set()
    thread.join()
    runs = bed.runs(at, 1)
    return Result(f"{len(runs)} RUN forward", not runs)


@scenario(
    5,
    "the router is killed at 0.3 m/s",
    "no RUN later than 0.5 s, for 3 s; the board holds STOP or BRAKE",
)
def router_killed(bed: Testbed) -> Result:
    with bed.source() as source:
        bed.drive(source, 0.3)
        at = time.monotonic()
        bed.stack.kill("router")
        time.sleep(3.0)
    runs = bed.runs(at)
    last = runs[-1].at - at if runs else 0.0
    held = bed.board.commands[-1].kind
    text = f"last RUN after {seconds(last)}; {held} is held"
    return Result(text, last <= 0.5 and held != "run")


@scenario(
    5,
    "safety is stopped by SIGSTOP at 0.4 m/s, a hit 50 ms later",
    "BRAKE within 0.1 s of the hit",
)
def hung_safety(bed: Testbed) -> Result:
    with bed.source() as source:
        bed.drive(source, 0.4)
        os.kill(bed.stack.processes["safety"].pid, signal.SIGSTOP)
        time.sleep(0.05)
        at = time.monotonic()
        bed.board.bumper = 1
        brake = bed.first("brake", at, 2.0)
        os.kill(bed.stack.processes["safety"].pid, signal.SIGCONT)
    return Result(f"BRAKE {seconds(brake)}", brake is not None and brake <= 0.1)


@scenario(
    6,
    "nav requests 0.3 m/s throughout; teleop backs away for 1 s and lets go",
    "nav does not move for 3 s; after a neutral request of its own it does",
)
def override(bed: Testbed) -> Result:
    with bed.source("nav") as nav:
        bed.drive(nav, 0.3)
        with bed.source("teleop") as teleop:
            bed.drive(teleop, -0.2)
            time.sleep(1.0)
            teleop.silence()
            at = time.monotonic()
            bed.wait(lambda: not bed.runs(time.monotonic() - 0.1, -1), 2.0, "teleop goes on")
        time.sleep(max(0.0, at + 3.0 - time.monotonic()))
        forward = bed.runs(at, 1)
        resumed = forward[0].at - at if forward else None
        nav.request(0.0)
        time.sleep(0.4)
        neutral = time.monotonic()
        nav.request(0.3)
        time.sleep(1.5)
        again = bool(bed.runs(neutral, 1))
    text = f"nav resumes {seconds(resumed)}; after neutral: {'drives' if again else 'stands'}"
    return Result(text, resumed is None and again)
