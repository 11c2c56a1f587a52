"""``python -m bench.reaction.by_zmq board PORT ADDRESS | judge ADDRESS``: ZeroMQ over IPC."""

import sys

import zmq

from bench.reaction.pair import HIT, Gate


def board(port: int, address: str) -> None:
    """Stand between the board and the judge until killed."""
    gate, context = Gate(port), zmq.Context()
    hits, verdicts = context.socket(zmq.PUB), context.socket(zmq.SUB)
    hits.bind(f"{address}.hits")
    verdicts.bind(f"{address}.verdicts")
    verdicts.subscribe(b"")
    poller = zmq.Poller()
    poller.register(gate.sock, zmq.POLLIN)
    poller.register(verdicts, zmq.POLLIN)
    while True:
        for ready, _ in poller.poll():
            if ready is verdicts:
                verdicts.recv()
                gate.brake()
            elif gate.take():
                hits.send(HIT)


def judge(address: str) -> None:
    """Decide until killed."""
    context = zmq.Context()
    hits, verdicts = context.socket(zmq.SUB), context.socket(zmq.PUB)
    hits.connect(f"{address}.hits")
    verdicts.connect(f"{address}.verdicts")
    hits.subscribe(b"")
    while True:
        verdicts.send(hits.recv())


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["board", port, address]:
            board(int(port), address)
        case ["judge", address]:
            judge(address)
