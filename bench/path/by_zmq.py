"""ZeroMQ over IPC; ``where`` is an address."""

import zmq

from bench.path.twist import Say, packed, unpacked


def sender(where: str) -> Say:
    """Return what sends."""
    context = zmq.Context()
    out = context.socket(zmq.PUB)
    out.bind(where)
    return lambda *twist: out.send(packed(*twist))


def listen(where: str, take: Say) -> None:
    """Take what comes, until killed."""
    context = zmq.Context()
    came = context.socket(zmq.SUB)
    came.connect(where)
    came.subscribe(b"")
    while True:
        take(*unpacked(came.recv()))
