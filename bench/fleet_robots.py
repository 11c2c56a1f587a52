"""``python -m bench.fleet_robots SITE MODEL ROBOT ...``: simulated robots, as a child process.

Each has its own session to the site's router, a peer as a robot's router, with a robot's
declarations. It repeats the messages that the real robot MODEL sends, at their rates.
"""

import contextlib
import itertools
import json
import sys
import threading
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import msgpack
import zenoh

from common import clock, keys
from common.bus.session import client_config
from verification.harness.bus import at
from verification.harness.child_process import serve

RECORD_S = 4.0  # health comes every second
AT_ONCE = 8  # sessions that open in parallel: each takes half a second, mostly waiting
SLEEP_MIN_S = 0.0005
INNER = ("tel/**", "@cmd/motion", "@cmd/drive/*")  # what a robot's services subscribe to
SERVICES = ("bridge", "safety", "odom", "recorder")
Recording = Sequence[tuple[float, zenoh.Sample]]  # with the time since the begin


def path_of(sample: zenoh.Sample) -> str:
    """Return the key below the robot's name."""
    return str(sample.key_expr).split("/", 3)[3]


def recorded(site: str, robot: str) -> Recording:
    """Record what a robot sends."""
    messages, begin_s = list[tuple[float, zenoh.Sample]](), time.monotonic()
    with zenoh.open(client_config(at(site))) as session:
        declared = session.declare_subscriber(
            f"{keys.ROOT}/{robot}/tel/**",
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
        infos = itertools.product([name], SERVICES, ("schema", "config", "last"))
        answered = [
            *(call.on(name) for call in keys.CALLS),
            *itertools.starmap(keys.info_key, infos),
        ]
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


def run(robots: Sequence[Robot], recording: Recording) -> None:
    """Publish all due messages, also late ones, until standard input ends; spread the robots."""
    left = threading.Event()
    serve(lambda: None, lambda: None, left.set)
    slots = sorted(
        ((at_s + RECORD_S * number / len(robots)) % RECORD_S, number, index)
        for number, (index, (at_s, _)) in itertools.product(
            range(len(robots)), enumerate(recording)
        )
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
    """Run the robots until standard input ends."""
    site, model, *names = sys.argv[1:]
    settings = {
        "mode": "peer", "listen/endpoints": [], "connect/timeout_ms": 30_000,
        "connect/exit_on_failure": True,
    }  # fmt: skip
    config = client_config(at(site))
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    recording = recorded(site, model)
    with contextlib.ExitStack() as stack, ThreadPoolExecutor(AT_ONCE) as pool:
        sessions = list(map(stack.enter_context, pool.map(zenoh.open, [config] * len(names))))
        robots = zip(sessions, names, strict=True)
        run([Robot(session, name, recording) for session, name in robots], recording)


if __name__ == "__main__":
    main()
