"""``python -m bench.fleet SITE ROBOT ...``: simulated robots behind one site's router; its cost.

One robot is a real stack with its own router, driven from the site. The others are simulated, in a
child process: each has its own session to the site's router, a peer as a robot's router, with a
robot's declarations, and repeats what the real robot sends. All run on this host, in plain TCP.
"""

import itertools
import json
import sys
import tempfile
import threading
import time
from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, nullcontext
from pathlib import Path
from typing import Any

import msgpack
import zenoh

from bench.child_process import ChildProcess, serve
from bench.figures import CPU, HOST, MS, ONE, Column, Figures, Limits, Unit
from bench.host import watched
from bench.load import MARGIN
from bench.processes import cpu_shares
from common import clock
from common.bus.session import client_config
from common.freshness import NS_PER_S
from sim.trace import Command
from t2 import keys
from verification.harness.bus import at, router_process
from verification.harness.ports import free_port
from verification.harness.process_stats import stat
from verification.harness.stack import RunningStack, running_stack
from verification.harness.trace import TraceFollower

REAL, ROBOTS, SECONDS = "berlin-001", (1, 10, 50), 6.0
SETTLE_S, ANSWER_S, OWN_ROUTER = 2.0, 1.0, "at its own router"
# Key expressions of the consumer at the site.
CONSUMED = {"nothing": (), "everything": (f"{keys.ROOT}/*/tel/**", f"{keys.ROOT}/*/evt/*")}
RECORD_S = 4.0  # health comes every second
AT_ONCE = 8  # sessions that open in parallel: each takes half a second, mostly waiting
SLEEP_MIN_S = 0.0005
INNER = ("tel/**", "@cmd/motion", "@cmd/drive/*")  # what a robot's services subscribe to
SERVICES = ("bridge", "safety", "odom", "recorder")
INFOS = ("schema", "config", "last")
Recording = Sequence[tuple[float, zenoh.Sample]]  # with the time since the begin
PATIENCE_NS = NS_PER_S  # a later frame is not the answer
SAME_MPS = 0.0004  # resolution of the wire: 1 mm/s


def measure(robots: Sequence[int] = ROBOTS, seconds: float = SECONDS) -> Figures:
    """Return the figures of each number of robots and subscription."""
    site = f"tcp/127.0.0.1:{free_port()}"
    sets = [f"robot.id={REAL}", f"bus.uplink={site}"]
    made: dict[tuple[str, ...], Sequence[float]] = {}
    with (
        tempfile.TemporaryDirectory() as folder,
        router_process(site) as router,
        running_stack(Path(folder), sets=sets, shipped=True) as stack,
    ):
        made |= window(stack, site, router.pid, ("1", OWN_ROUTER), seconds)
        for count in robots:
            names = [f"berlin-{number:03d}" for number in range(2, count + 1)]
            others = ChildProcess("bench.fleet", site, *names) if names else nullcontext()
            with others:
                for what in CONSUMED:
                    made |= window(stack, site, router.pid, (str(count), what), seconds)
    return made


def window(
    stack: RunningStack, site: str, pid: int, name: tuple[str, str], seconds: float
) -> Figures:
    """Measure with this subscription at the site, while the real robot is driven."""
    endpoint = stack.endpoint if name[1] == OWN_ROUTER else site
    frames, late_ns = TraceFollower(stack.trace_file), list[int]()
    with (
        ChildProcess(
            "bench.zenoh_programs", "consume", site, *CONSUMED.get(name[1], ())
        ) as consumer,
        ChildProcess("bench.client", endpoint, "drive", REAL) as source,
    ):
        time.sleep(SETTLE_S)
        frames.follow().forget()
        consumer.send("begin")
        source.send("begin")
        with watched(late_ns):
            shares = cpu_shares({"site": pid}, seconds)
        came, asked = consumer.end(), source.end()
        time.sleep(ANSWER_S)
    took: Sequence[int | None] = answers_ns(asked, frames.follow().commands)
    return {(*name, what): samples for what, samples in {
        "site": [shares["site"].total],
        "memory": [stat(pid).rss], "arrived": [came["hz"]],
        "bytes": [came["bytes_per_s"] / int(name[0])], "age": came["ages_ns"],
        "request": [ns for ns in took if ns is not None], "unanswered": [took.count(None)],
        HOST: late_ns,
    }.items()}  # fmt: skip


def answers_ns(
    requests: Sequence[tuple[int, float]], commands: Sequence[Command]
) -> list[int | None]:
    """Return the time from each request to the frame with its speed; None for a missing frame."""
    times = [command.mono_ns for command in commands]
    found: list[int | None] = []
    for at_ns, linear in requests:
        after = commands[bisect_left(times, at_ns) : bisect_left(times, at_ns + PATIENCE_NS)]
        same = (c for c in after if c.kind == "run" and abs(c.linear - linear) < SAME_MPS)
        found.append(next((c.mono_ns - at_ns for c in same), None))
    return found


COLUMNS = (
    Column("arrived /s", "arrived", ONE), Column("of one,", "bytes", Unit("kbit/s", 125)),
    Column("age", "age", MS), Column("site's router", "site", CPU),
    Column("its memory", "memory", Unit("MB", 1e6)), Column("request p50", "request", MS),
    Column("p99", "request", MS, "p99"), Column("unanswered", "unanswered", ONE),
)  # fmt: skip
LIMITS: Limits = [
    (("50", "everything"), ("1", "everything"), COLUMNS[3], 50 * MARGIN),
    (("50", "everything"), ("1", OWN_ROUTER), COLUMNS[5], 3.0),
]


def path_of(sample: zenoh.Sample) -> str:
    """Return the key below the robot's name."""
    return str(sample.key_expr).split("/", 3)[3]


def recorded(site: str) -> Recording:
    """Record what a robot sends."""
    messages, begin_s = list[tuple[float, zenoh.Sample]](), time.monotonic()
    with zenoh.open(client_config(at(site))) as session:
        declared = session.declare_subscriber(
            f"{keys.ROOT}/{REAL}/tel/**",
            lambda sample: messages.append((time.monotonic() - begin_s, sample)),
        )
        time.sleep(RECORD_S)
        declared.undeclare()
    return [(at_s, sample) for at_s, sample in messages if at_s < RECORD_S]


class Robot:
    """One simulated robot."""

    def __init__(self, session: zenoh.Session, name: str, recording: Recording) -> None:
        self._seqs: Counter[str] = Counter()
        self._publishers = {
            path: session.declare_publisher(
                f"{keys.ROOT}/{name}/{path}", priority=sample.priority, express=sample.express,
                congestion_control=sample.congestion_control,
            )
            for path, sample in {path_of(sample): sample for _, sample in recording}.items()
        }  # fmt: skip
        answered = [call.on(name) for call in keys.CALLS]
        answered += [keys.info_key(name, s, i) for s in SERVICES for i in INFOS]
        inner = [keys.estop_key(name), *(f"{keys.ROOT}/{name}/{path}" for path in INNER)]
        remote = zenoh.Locality.REMOTE  # ignore its own messages
        self._declared: list[Any] = [
            *(session.liveliness().declare_token(keys.live_key(name, s, "1")) for s in SERVICES),
            *(session.declare_queryable(key, print) for key in answered),
            *(session.declare_subscriber(key, print, allowed_origin=remote) for key in inner),
        ]

    def put(self, sample: zenoh.Sample) -> None:
        """Repeat a recorded message, with its own number and time."""
        path, message = path_of(sample), msgpack.unpackb(sample.payload.to_bytes())
        self._seqs[path] += 1
        message |= {"seq": self._seqs[path], "mono_ns": clock.now_ns()}
        self._publishers[path].put(msgpack.packb(message), attachment=sample.attachment)


def publish(robots: Sequence[Robot], recording: Recording) -> None:
    """Publish all due messages, also late ones, until standard input ends; spread the robots."""
    left = threading.Event()
    serve(lambda: None, lambda: None, left.set)
    shifts_s = [RECORD_S * number / len(robots) for number in range(len(robots))]
    slots = sorted(
        ((at_s + shift_s) % RECORD_S, number, index)
        for number, shift_s in enumerate(shifts_s)
        for index, (at_s, _) in enumerate(recording)
    )
    begin_s = time.monotonic()
    for turn in itertools.count():
        for at_s, number, index in slots:
            wait_s = begin_s + turn * RECORD_S + at_s - time.monotonic()
            if wait_s > SLEEP_MIN_S:
                time.sleep(wait_s)
            robots[number].put(recording[index][1])
            if left.is_set():
                return


def main() -> None:
    """Run the simulated robots until standard input ends."""
    site, *names = sys.argv[1:]
    settings = {
        "mode": "peer", "listen/endpoints": [], "connect/timeout_ms": 30_000,
        "connect/exit_on_failure": True,
    }  # fmt: skip
    config = client_config(at(site))
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    recording = recorded(site)
    with ExitStack() as stack, ThreadPoolExecutor(AT_ONCE) as pool:
        sessions = list(map(stack.enter_context, pool.map(zenoh.open, [config] * len(names))))
        robots = zip(sessions, names, strict=True)
        publish([Robot(session, name, recording) for session, name in robots], recording)


if __name__ == "__main__":
    main()
