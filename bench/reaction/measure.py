"""Measurement of the benchmark ``reaction``, block by block, on a quiet and a busy host."""

import random
import subprocess
import sys
import tempfile
from pathlib import Path

from bench.path import processes
from bench.reaction.board import Programs, compiled
from bench.reaction.responders import RESPONDERS, Responder
from bench.series import Series
from common import realtime
from verification.harness.ports import udp_ports

SEED = 20_240_607
BLOCKS, HITS, WARM = 2, 400, 20
BUSY = 4  # processes with a busy loop, on the busy host


def measure(blocks: int = BLOCKS, hits: int = HITS) -> list[Series]:
    """Return the samples of all responders."""
    here = [each for each in RESPONDERS if not each.lacks]
    turns = [(each, load) for each in here for load in each.loads]
    samples: dict[tuple[str, str], list[int]] = {(each.name, load): [] for each, load in turns}
    shuffler = random.Random(SEED)
    with tempfile.TemporaryDirectory() as folder:
        programs = compiled(Path(folder))
        for _ in range(blocks):
            shuffler.shuffle(turns)
            for responder, load in turns:
                with processes.loaded(BUSY if load == "busy" else 0):
                    samples[responder.name, load] += block(programs, responder, hits)
    note = "granted" if is_granted() else "not granted, so these rows have no meaning"
    return [Series(name=name, samples_ns=some, note=note) for name, some in samples.items()]


def block(programs: Programs, responder: Responder, hits: int) -> list[int]:
    """Return the reaction times of a block, in ns."""
    board, port = udp_ports(2)
    with responder.start(programs, port, board):
        return programs.hits(board, port, hits, WARM)


def is_granted() -> bool:
    """Return whether this host grants SCHED_FIFO."""
    script = "from common import realtime as r; r.request(r.GUARD); print(r.priority())"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True)
    return done.stdout.strip() == str(realtime.GUARD).encode()


def versions() -> str:
    """Return the compared packages with versions, and the rows that are left out."""
    return processes.versions(RESPONDERS)
