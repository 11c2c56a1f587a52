"""ZeroMQ over IPC; ``where`` is an address."""

import zmq

from bench.adapters.protocols import HIT, BoardSocket, Twist, packed, unpacked


def source(where: str) -> Twist:
    """Return a function that publishes a twist."""
    publisher = zmq.Context().socket(zmq.PUB)
    publisher.bind(where)
    return lambda *twist: publisher.send(packed(*twist))


def subscribe(where: str, take: Twist) -> None:
    """Pass received twists on until killed."""
    context = zmq.Context()
    subscriber = context.socket(zmq.SUB)
    subscriber.connect(where)
    subscriber.subscribe(b"")
    while True:
        take(*unpacked(subscriber.recv()))


def board(sock: BoardSocket, where: str) -> None:
    """Run the process at the board until killed."""
    context = zmq.Context()
    hits, verdicts = context.socket(zmq.PUB), context.socket(zmq.SUB)
    hits.bind(f"{where}.hits")
    verdicts.bind(f"{where}.verdicts")
    verdicts.subscribe(b"")
    poller = zmq.Poller()
    poller.register(sock.sock, zmq.POLLIN)
    poller.register(verdicts, zmq.POLLIN)
    while True:
        for ready, _ in poller.poll():
            if ready is verdicts:
                verdicts.recv()
                sock.brake()
            elif sock.receive_hit():
                hits.send(HIT)


def decide(where: str) -> None:
    """Run the process that decides until killed."""
    context = zmq.Context()
    hits, verdicts = context.socket(zmq.SUB), context.socket(zmq.PUB)
    hits.connect(f"{where}.hits")
    verdicts.connect(f"{where}.verdicts")
    hits.subscribe(b"")
    while True:
        verdicts.send(hits.recv())
