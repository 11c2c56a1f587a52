"""The part ``reaction``: everybody in turn, block by block, on a quiet machine and a busy one."""

import contextlib
import random
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

from bench.reaction.board import Programs, compiled
from bench.reaction.page import LOADS
from bench.reaction.responders import RESPONDERS, Responder
from bench.series import Series
from tests.support import free_port

SEED = 20_240_607
BLOCKS, HITS, WARM = 2, 250, 20
BUSY = 4  # processes that only count, on the busy machine


def measure(blocks: int = BLOCKS, hits: int = HITS) -> list[Series]:
    """Return the samples of all, each in so many blocks of so many hits."""
    here = [each for each in RESPONDERS if not each.lacks]
    samples: dict[tuple[str, str], list[int]] = {
        (each.name, load): [] for each in here for load in LOADS
    }
    shuffler = random.Random(SEED)
    with tempfile.TemporaryDirectory() as folder:
        programs = compiled(Path(folder))
        for _ in range(blocks):
            turns = [(each, load) for each in here for load in LOADS]
            shuffler.shuffle(turns)
            for responder, load in turns:
                with loaded(BUSY if load == "busy" else 0):
                    samples[responder.name, load] += block(programs, responder, hits)
    return [Series(name=name, calls=1, samples_ns=some) for name, some in samples.items()]


def block(programs: Programs, responder: Responder, hits: int) -> list[int]:
    """Return how long so many BREAKs took, in ns."""
    board, port = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_DGRAM)
    with responder.start(programs, port, board):
        return programs.hits(board, port, hits, WARM)


@contextlib.contextmanager
def loaded(processes: int) -> Iterator[None]:
    """Keep so many processes counting while the context lasts."""
    command = [sys.executable, "-S", "-c", "while True: pass"]
    with contextlib.ExitStack() as stack:
        for _ in range(processes):
            busy = stack.enter_context(subprocess.Popen(command))
            stack.callback(busy.kill)
        yield


def versions() -> str:
    """Return what is compared, with versions, and what is not here."""
    here = [each.package for each in RESPONDERS if each.package and not each.lacks]
    told = [f"{name} {version(name)}" for name in ("eclipse-zenoh", *here)]
    lacking = [
        f"{each.name} left out, {each.lacks} is not installed" for each in RESPONDERS if each.lacks
    ]
    return ", ".join([*told, *lacking])
