"""``python -m bench.load.bare_zenoh board PORT BOARD ENDPOINT | judge ENDPOINT``: as ``bare``.

The same two, but what goes from one to the other goes by Zenoh and a router.
"""

import sys
import time
from threading import Event
from typing import Any

import msgpack
import zenoh

from bench.load.bare import MOTION, MOTION_S, Gate
from bench.reaction.by_zenoh import joined, publisher, subscribe
from common.keys import COMMAND, FAST

REPORTS, MOTIONS = "reports", "motions"


def stand(port: int, board: int, session: zenoh.Session) -> None:
    """Stand between the board and the other one until killed."""
    gate = Gate(port, board, publisher(session, REPORTS, FAST).put)
    heard = Event()

    def hear(sample: zenoh.Sample) -> None:
        gate.obey(sample.payload.to_bytes())
        say_once(heard)

    subscribe(session, MOTIONS, hear)
    gate.run()


def say_once(heard: Event) -> None:
    """Tell whoever started this process that the other one is heard."""
    if not heard.is_set():
        heard.set()
        sys.stdout.write("heard\n")
        sys.stdout.flush()


def judge(session: zenoh.Session) -> None:
    """Keep the newest of each kind, and say a motion by the clock, until killed."""
    newest: dict[int, Any] = {}
    heard = Event()

    def hear(sample: zenoh.Sample) -> None:
        message = msgpack.unpackb(sample.payload.to_bytes())
        newest[message["kind"]] = message["values"]
        say_once(heard)

    motions = publisher(session, MOTIONS, COMMAND)
    subscribe(session, REPORTS, hear)
    due_s = time.monotonic()
    while True:
        motions.put(MOTION)
        due_s = max(due_s + MOTION_S, time.monotonic())
        time.sleep(max(0.0, due_s - time.monotonic()))


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["board", port, board, endpoint]:
            stand(int(port), int(board), joined(endpoint))
        case ["judge", endpoint]:
            judge(joined(endpoint))
