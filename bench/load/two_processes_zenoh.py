"""``... two_processes_zenoh board PORT BOARD ENDPOINT | decide ENDPOINT``: as ``two_processes``.

The two processes exchange their messages by Zenoh with a router.
"""

import sys
import time
from threading import Event
from typing import Any

import msgpack
import zenoh

from bench.adapters.zenoh import connected, declare, publisher
from bench.load.two_processes import MOTION, MOTION_S, BoardProcess
from common.keys import COMMAND, FAST

REPORTS, MOTIONS = "reports", "motions"


def run_board(port: int, board: int, session: zenoh.Session) -> None:
    """Run the process at the board until killed."""
    process = BoardProcess(port, board, publisher(session, REPORTS, FAST).put)
    received = Event()

    def take(sample: zenoh.Sample) -> None:
        process.send_frame(sample.payload.to_bytes())
        report_once(received)

    declare(session, MOTIONS, take)
    process.run()


def report_once(received: Event) -> None:
    """Report the first message of the other process on standard output, once."""
    if not received.is_set():
        received.set()
        sys.stdout.write("received\n")
        sys.stdout.flush()


def decide(session: zenoh.Session) -> None:
    """Store the newest of each kind and publish a motion periodically, until killed."""
    newest: dict[int, Any] = {}
    received = Event()

    def take(sample: zenoh.Sample) -> None:
        message = msgpack.unpackb(sample.payload.to_bytes())
        newest[message["kind"]] = message["values"]
        report_once(received)

    motions = publisher(session, MOTIONS, COMMAND)
    declare(session, REPORTS, take)
    due_s = time.monotonic()
    while True:
        motions.put(MOTION)
        due_s = max(due_s + MOTION_S, time.monotonic())
        time.sleep(max(0.0, due_s - time.monotonic()))


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["board", port, board, endpoint]:
            run_board(int(port), int(board), connected(endpoint))
        case ["decide", endpoint]:
            decide(connected(endpoint))
