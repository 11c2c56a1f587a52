"""Which recordings are removed to make room for new ones. Pure.

Continuous recordings go first, then incidents, the oldest of each first. The newest of each kind
stays, and so does what is marked as kept or still being written. A file whose name the recorder
did not give is never touched.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import accumulate

KEEP = ".keep"  # FILE.mcap.keep beside FILE.mcap marks it as kept
NAME = re.compile(r"(\d{8}-\d{6})(-latch-.+?)?(?:-(\d+))?\.mcap")


@dataclass(frozen=True, slots=True)
class Stored:
    """A recording on the disk."""

    name: str
    size: int  # bytes
    kept: bool = False  # marked, or still being written


def removable(files: Iterable[Stored], robot: str) -> list[Stored]:
    """Return what may go, in the order in which it goes."""
    dated = []
    for file in files:
        prefix, name = file.name[: len(robot) + 1], file.name[len(robot) + 1 :]
        match = NAME.fullmatch(name) if prefix == f"{robot}-" else None
        if match:
            stamp, latch, number = match.groups()
            dated.append((bool(latch), stamp, int(number or 0), file.name, file))
    dated.sort(key=lambda each: each[:4])
    kinds = [[each[-1] for each in dated if each[0] is incident] for incident in (False, True)]
    return [file for kind in kinds for file in kind[:-1] if not file.kept]


def to_remove(files: Iterable[Stored], robot: str, needed: float, wanted: float) -> list[Stored]:
    """Return what to remove for so many bytes: ``wanted`` if there is as much, else ``needed``.

    Nothing when all of it is less than ``needed``: it would be lost and no room gained.
    """
    candidates = removable(files, robot)
    sums = list(accumulate(file.size for file in candidates))
    if not sums or sums[-1] < needed:
        return []
    enough = next((i for i, freed in enumerate(sums) if freed >= wanted), len(sums) - 1)
    return candidates[: enough + 1]
