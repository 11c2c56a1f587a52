"""Retention policy: selects the recordings to remove when the disk runs full. Pure.

Continuous recordings are removed first, then incidents, the oldest of each first. The newest
recording of each kind is kept, and so are the recorder's latest files and those that are marked.
Files that the recorder did not name itself are never removed.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import accumulate

KEEP = ".keep"  # FILE.mcap.keep beside FILE.mcap marks it as kept
NAME = re.compile(r"(\d{8}-\d{6})(-latch-.+?)?(?:-(\d+))?\.mcap")


@dataclass(frozen=True, slots=True)
class StoredFile:
    """A recording on the disk."""

    name: str
    size: int  # bytes
    kept: bool = False  # marked, or the recorder's latest


def removable(files: Iterable[StoredFile], robot: str) -> list[StoredFile]:
    """Return the files that may be removed, in the order of their removal."""
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


def to_remove(
    files: Iterable[StoredFile], robot: str, needed: float, wanted: float
) -> list[StoredFile]:
    """Return the files to remove, to free ``wanted`` bytes if possible, else ``needed``.

    Return nothing if all candidates together are smaller than ``needed``: removing them would not
    make enough room.
    """
    candidates = removable(files, robot)
    sums = list(accumulate(file.size for file in candidates))
    if not sums or sums[-1] < needed:
        return []
    enough = next((i for i, freed in enumerate(sums) if freed >= wanted), len(sums) - 1)
    return candidates[: enough + 1]
