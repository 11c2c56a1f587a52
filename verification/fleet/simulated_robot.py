"""``python -m verification.fleet.simulated_robot``: many simulated robots in one process.

Each has its own session to the site's router with the declarations and the messages of a real
robot. An emergency stop latches it.
"""

import argparse
import contextlib
import itertools
import json
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import msgspec
import zenoh

from common import clock, keys
from common.bus.publisher import Publisher
from common.bus.session import client_config
from common.messages import Message, SafetyState
from services.recorder.reader import Reader
from verification.fleet.streams import SERVICES, Stream, downsampling, schedule, streams
from verification.harness.bus import at
from verification.harness.child_process import serve

LAP = Path(__file__).parents[2] / "tests/recorder/lap.mcap"
AT_ONCE = 8  # sessions that open in parallel: each takes half a second, mostly waiting
SLEEP_MIN_S = 0.0005
INNER = ("tel/**", "@cmd/motion", "@cmd/drive/*")  # what a robot's services subscribe to


class Robot:
    """One simulated robot."""

    def __init__(self, session: zenoh.Session, name: str, all_streams: Sequence[Stream]) -> None:
        self.stopped = False
        self._boot = clock.now_ns()
        self._streams = all_streams
        self._sent: Counter[str] = Counter()
        self._publishers: list[Publisher[Message]] = []
        for stream in all_streams:
            key = stream.topic.on(name, **stream.names)
            self._publishers.append(Publisher(stream.topic, key, self._boot, self._sent, 1))
        for service in SERVICES:
            key = keys.EVENTS.on(name, service=service)
            events: Publisher[Any] = Publisher(keys.EVENTS, key, self._boot, self._sent)
            self._publishers.append(events)
        for publisher in self._publishers:
            publisher.declare(session)
        self._declared = self._declare(session, name)

    def put(self, number: int) -> None:
        """Publish one stream."""
        stream = self._streams[number]
        message = stream.message
        if isinstance(message, SafetyState):
            latched = ("estop",) if self.stopped else ()
            message = msgspec.structs.replace(message, latched=latched)
        self._publishers[number].put(message, stream.raw)

    def _declare(self, session: zenoh.Session, name: str) -> list[Any]:
        def stop(_: zenoh.Sample) -> None:
            self.stopped = True

        remote = zenoh.Locality.REMOTE  # ignore its own messages
        tokens = [
            session.liveliness().declare_token(keys.live_key(name, service, f"{self._boot:x}"))
            for service in SERVICES
        ]
        read = [
            session.declare_subscriber(f"{keys.ROOT}/{name}/{path}", print, allowed_origin=remote)
            for path in INNER
        ]
        answered = [call.on(name) for call in keys.CALLS]
        answered += [
            keys.info_key(name, service, part)
            for service in SERVICES
            for part in ("schema", "config", "last")
        ]
        served = [session.declare_queryable(key, print) for key in answered]
        return [
            *tokens, *read, *served, session.declare_subscriber(keys.estop_key(name), stop),
        ]  # fmt: skip


def config(site: str, shape: str, thin: list[dict[str, object]]) -> zenoh.Config:
    """Return the configuration of a session to the site: peer (as robots), router or client."""
    made = client_config(at(site))
    made.insert_json5("mode", json.dumps(shape))
    made.insert_json5("listen/endpoints", "[]")
    made.insert_json5("connect/timeout_ms", "30000")
    made.insert_json5("connect/exit_on_failure", "true")
    if thin:
        made.insert_json5("downsampling", json.dumps(thin))
    return made


def recorded() -> list[Stream]:
    """Return a robot's streams from the recording in the tests."""
    with Reader(LAP) as reader:
        return streams(itertools.takewhile(lambda row: not latched(row[1]), rows(reader)))


def rows(reader: Reader) -> Iterator[tuple[str, Message, bytes | None]]:
    """Yield path, message and frame of each recorded message."""
    for entry in reader:
        if (message := entry.message) is not None:
            yield entry.key.split("/", 3)[3], message, entry.sample.raw


def latched(message: Message) -> bool:
    """Return whether safety latched, which ends the usable part of the lap."""
    return isinstance(message, SafetyState) and bool(message.latched)


class Generator:
    """Publishes for all simulated robots, and counts."""

    def __init__(self, robots: Sequence[Robot], all_streams: Sequence[Stream]) -> None:
        self.left = threading.Event()
        self._robots = robots
        self._slots = schedule(all_streams, len(robots))
        self._sent = 0
        self._late_s: list[float] = []

    def run(self) -> None:
        """Publish all due messages, also late ones, until ``left`` is set."""
        begin_s, second = time.monotonic(), 0
        while not self.left.is_set():
            for at_s, robot, number in self._slots:
                wait_s = begin_s + second + at_s - time.monotonic()
                if wait_s > SLEEP_MIN_S:
                    time.sleep(wait_s)
                self._robots[robot].put(number)
                self._sent += 1
            self._late_s.append(time.monotonic() - begin_s - second - 1.0)
            second += 1

    def begin(self) -> None:
        self._sent, self._late_s = 0, []
        self._since_s = time.monotonic()

    def end(self) -> object:
        """Return the rate, the intended rate and the lateness."""
        past_s = time.monotonic() - self._since_s
        return {
            "hz": self._sent / past_s,
            "wanted_hz": len(self._slots),
            "late_s": max(self._late_s, default=0.0),
            "stopped": sum(robot.stopped for robot in self._robots),
        }


def main(argv: Sequence[str] | None = None) -> None:
    """Run the robots until standard input ends."""
    options = arguments().parse_args(argv)
    all_streams = recorded()
    with contextlib.ExitStack() as stack:
        pool = stack.enter_context(ThreadPoolExecutor(AT_ONCE))

        def opened(name: str) -> Robot:
            thin = downsampling(name, all_streams, options.thin) if options.thin else []
            session = stack.enter_context(zenoh.open(config(options.site, options.shape, thin)))
            return Robot(session, name, all_streams)

        robots = list(pool.map(opened, options.names))
        generator = Generator(robots, all_streams)
        generator.begin()
        serve(generator.begin, generator.end, generator.left.set)
        generator.run()


def arguments() -> argparse.ArgumentParser:
    """Return the argument parser."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("site", help="the site's router")
    parser.add_argument("names", nargs="+")
    parser.add_argument("--shape", choices=["router", "peer", "client"], default="peer")
    parser.add_argument("--thin", type=float, default=0.0, metavar="HZ", help="of each stream")
    return parser


if __name__ == "__main__":
    main()
