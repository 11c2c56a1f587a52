"""Highest rate of frames through the bridge without a loss, for several numbers of consumers."""

import contextlib
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from statistics import median
from typing import Any

import zenoh

from bench.load.board import STANDS, Board, board
from bench.load.consumer import plain
from bench.load.loss import Passage, highest
from bench.load.stack import Pids, Ports, bridge_pid, stack
from bench.series import Series
from common import keys
from common.wire.frame import Frame
from verification.harness.child_process import ChildProcess
from verification.harness.process_stats import CpuShares, udp_drops
from verification.harness.waiting import wait_until

CONSUMERS = (1, 5, 20)
RATES = (500, 1000, 1500, 2000, 3000, 4000, 5000, 6000, 8000, 10_000, 12_000, 15_000)
HELD_S = 3.0
TRIES = 2  # a stall of the host may fail the first one
AT_ONCE = 8  # consumers that start in parallel
RESTARTED = "the guard has restarted the bridge"
SILENT: Mapping[Frame, float] = {STANDS: 0.0}  # only answers until ``send``
VELOCITY, LAST = keys.VELOCITY.on("001"), keys.info_key("001", "bridge", "last")


@dataclass(frozen=True, slots=True)
class Testbed:
    """A board, the bridge with its router, consumers, and a session for queries."""

    ports: Ports
    pids: Pids
    board: Board
    session: zenoh.Session
    consumers: Sequence[ChildProcess]

    def published(self) -> int:
        """Query how many velocities the bridge has published."""
        last = wait_until(lambda: last_messages(self.session), "an answer of the bridge")
        return int(last[VELOCITY]["seq"]) if VELOCITY in last else 0


def measure(
    program: Path,
    counts: Sequence[int] = CONSUMERS,
    rates: Sequence[int] = RATES,
    seconds: float = HELD_S,
) -> list[Series]:
    """Return the results of each rate, for each number of consumers."""
    ports, found = Ports(), dict[tuple[str, ...], Series]()
    with (
        stack(ports, ("bridge",)) as pids,
        board(program, ports.board, ports.bridge, SILENT) as sender,
        zenoh.open(plain(ports.endpoint)) as session,
    ):
        for count in counts:
            with consuming(ports.endpoint, VELOCITY, count) as consumers:
                testbed = Testbed(ports, pids, sender, session, consumers)

                def holds(hz: int, testbed: Testbed = testbed) -> bool:
                    for _ in range(TRIES):
                        made = trial(testbed, hz, seconds)
                        found.update({one.name: one for one in made})
                        if not made[0].note:
                            return True
                    return False

                highest(rates, holds)
    return list(found.values())


def trial(testbed: Testbed, hz: int, seconds: float) -> list[Series]:
    """Send at a rate; return the delay, with the losses as its note, and the CPU."""
    name = "frames", str(len(testbed.consumers)), str(hz)
    published, dropped = testbed.published(), udp_drops(testbed.ports.bridge)
    pids = {"router": testbed.pids["router"], "bridge": bridge_pid(testbed.pids["guard"])}
    for each in testbed.consumers:
        each.begin()
    with CpuShares(pids) as shares:
        sent = round(hz * seconds)
        pace = testbed.board.send(hz, sent) / hz
    counts = settled(testbed.consumers)
    if bridge_pid(testbed.pids["guard"]) != pids["bridge"]:
        return [Series(name=(*name, "delay"), samples_ns=[], note=RESTARTED)]
    passage = Passage(
        sent=sent,
        dropped=udp_drops(testbed.ports.bridge) - dropped,
        published=testbed.published() - published,
        received=[sum(came for came, *_ in each["keys"].values()) for each in counts],
        late_s=max(late_s(each["ages_ns"]) for each in counts),
        pace=pace,
    )
    ages_ns = list(chain.from_iterable(each["ages_ns"] for each in counts))
    return [
        Series(name=(*name, "delay"), samples_ns=ages_ns, note=passage.words),
        *(Series(name=(*name, process), samples_ns=[ns]) for process, ns in shares.ns.items()),
    ]


def last_messages(session: zenoh.Session) -> Any:
    """Query the bridge's last message of each key; None without an answer."""
    for reply in session.get(LAST, timeout=5.0):
        if reply.ok:
            return json.loads(reply.ok.payload.to_bytes())
    return None


def settled(consumers: Sequence[ChildProcess]) -> list[Any]:
    """Return the counts of the consumers once they do not change any more."""
    counts: list[Any] = []

    def still() -> bool:
        time.sleep(0.2)
        before, counts[:] = counts[:], [each.end() for each in consumers]
        return counts == before

    wait_until(still, "the last message")
    return counts


def late_s(ages_ns: Sequence[int]) -> float:
    """Return the age of messages, the median of all or of the last tenth, in seconds."""
    last = ages_ns[-max(1, len(ages_ns) // 10) :]
    return max(median(ages_ns), median(last)) / 1e9 if ages_ns else 0.0


@contextlib.contextmanager
def consuming(endpoint: str, key: str, count: int) -> Iterator[list[ChildProcess]]:
    """Run consumers of a key."""
    with contextlib.ExitStack() as held, ThreadPoolExecutor(AT_ONCE) as pool:
        started = pool.map(
            lambda _: ChildProcess("bench.load.consumer", endpoint, key), range(count)
        )
        yield [held.enter_context(each) for each in started]
