"""The highest rate of frames through the bridge without a loss, to so many consumers."""

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
from bench.load.stack import Pids, Ports, guarded, stack
from bench.series import Series
from common import keys
from common.wire.frame import Frame
from verification.fleet.child import Part
from verification.harness.process_stats import CpuShares, udp_drops
from verification.harness.waiting import wait_until

CONSUMERS = (1, 5, 20)
RATES = (
    500, 1000, 1500, 2000, 2500, 3000, 3500, 4000, 5000, 6000, 7000, 8000, 10_000, 12_000, 15_000,
)  # fmt: skip
HELD_S = 3.0
TRIES = 2  # a machine that held somebody up for a moment gets another one
AT_ONCE = 8  # consumers that are being started
ANEW = "the guard has started the bridge anew"
SILENT: Mapping[Frame, float] = {STANDS: 0.0}  # but for answers, until it is told to send
VELOCITY, LAST = keys.VELOCITY.on("001"), keys.info_key("001", "bridge", "last")


@dataclass(frozen=True, slots=True)
class Ground:
    """What runs: a board, the bridge with its router, consumers, and a session to look by."""

    ports: Ports
    pids: Pids
    board: Board
    session: zenoh.Session
    consumers: Sequence[Part]

    def published(self) -> int:
        """Return how many velocities the bridge has published, once it says so."""
        last = wait_until(lambda: told(self.session), "an answer of the bridge's")
        return int(last[VELOCITY]["seq"]) if VELOCITY in last else 0


def measure(
    program: Path,
    counts: Sequence[int] = CONSUMERS,
    rates: Sequence[int] = RATES,
    seconds: float = HELD_S,
) -> list[Series]:
    """Return what was measured at each rate that was tried, for each number of consumers."""
    ports, found = Ports(), dict[tuple[str, ...], Series]()
    with (
        stack(ports, ("bridge",)) as pids,
        board(program, ports.board, ports.bridge, SILENT) as sender,
        zenoh.open(plain(ports.endpoint)) as session,
    ):
        for count in counts:
            with listening(ports.endpoint, VELOCITY, count) as consumers:
                ground = Ground(ports, pids, sender, session, consumers)

                def holds(hz: int, ground: Ground = ground) -> bool:
                    for _ in range(TRIES):
                        made = trial(ground, hz, seconds)
                        found.update({one.name: one for one in made})
                        if not made[0].note:
                            return True
                    return False

                highest(rates, holds)
    return list(found.values())


def trial(ground: Ground, hz: int, seconds: float) -> list[Series]:
    """Send at a rate for so long; return the delay, with what was lost as a note, and the CPU."""
    name = "frames", str(len(ground.consumers)), str(hz)
    published, dropped = ground.published(), udp_drops(ground.ports.bridge)
    pids = {"router": ground.pids["router"], "bridge": guarded(ground.pids["guard"])}
    for each in ground.consumers:
        each.begin()
    with CpuShares(pids) as shares:
        sent = round(hz * seconds)
        pace = ground.board.send(hz, sent) / hz
    heard = settled(ground.consumers)
    if guarded(ground.pids["guard"]) != pids["bridge"]:
        return [Series(name=(*name, "delay"), samples_ns=[], note=ANEW)]
    passage = Passage(
        sent=sent,
        dropped=udp_drops(ground.ports.bridge) - dropped,
        published=ground.published() - published,
        received=[sum(came for came, *_ in each["keys"].values()) for each in heard],
        late_s=max(late_s(each["ages_ns"]) for each in heard),
        pace=pace,
    )
    ages_ns = list(chain.from_iterable(each["ages_ns"] for each in heard))
    return [
        Series(name=(*name, "delay"), samples_ns=ages_ns, note=passage.words),
        *(Series(name=(*name, who), samples_ns=[ns]) for who, ns in shares.ns.items()),
    ]


def told(session: zenoh.Session) -> Any:
    """Return the bridge's last message of each key; None when it does not answer."""
    for reply in session.get(LAST, timeout=5.0):
        if reply.ok:
            return json.loads(reply.ok.payload.to_bytes())
    return None


def settled(consumers: Sequence[Part]) -> list[Any]:
    """Return what consumers tell once nothing comes any more."""
    heard: list[Any] = []

    def still() -> bool:
        time.sleep(0.2)
        before, heard[:] = heard[:], [each.end() for each in consumers]
        return heard == before

    wait_until(still, "the last message")
    return heard


def late_s(ages_ns: Sequence[int]) -> float:
    """Return how old messages were, by the median of all or of the last tenth, in seconds."""
    last = ages_ns[-max(1, len(ages_ns) // 10) :]
    return max(median(ages_ns), median(last)) / 1e9 if ages_ns else 0.0


@contextlib.contextmanager
def listening(endpoint: str, key: str, count: int) -> Iterator[list[Part]]:
    """Run so many consumers of a key while the context lasts."""
    with contextlib.ExitStack() as held, ThreadPoolExecutor(AT_ONCE) as pool:
        started = pool.map(lambda _: Part("bench.load.consumer", endpoint, key), range(count))
        yield [held.enter_context(each) for each in started]
