"""``python -m bench.reaction.by_lcm board PORT URL | judge URL``: LCM, multicast on loopback."""

import select
import sys
from typing import Any

import lcm

from bench.reaction.pair import HIT, Gate


def board(port: int, url: str) -> None:
    """Stand between the board and the judge until killed."""
    gate, bus = Gate(port), lcm.LCM(url)
    bus.subscribe("verdicts", lambda *_: gate.brake())
    ends: list[Any] = [gate.sock, bus]
    while True:
        for ready in select.select(ends, [], [])[0]:
            if ready is bus:
                bus.handle()
            elif gate.take():
                bus.publish("hits", HIT)


def judge(url: str) -> None:
    """Decide until killed."""
    bus = lcm.LCM(url)
    bus.subscribe("hits", lambda *_: bus.publish("verdicts", HIT))
    while True:
        bus.handle()


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["board", port, url]:
            board(int(port), url)
        case ["judge", url]:
            judge(url)
