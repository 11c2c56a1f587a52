"""The recordings folder: file names, free space, and removal of old recordings.

A name has robot, number, UTC and reason: ``001-000042-20260315-081530-latch-contact.mcap``. The
number rises with each file, whatever the clock shows: it orders the files. Names of earlier
versions have none, and come before all that have one.

Continuous recordings are removed first, then incidents, the oldest of each first. The newest
recording of each kind is kept, and so are the recorder's latest files and those that are marked.
Files that the recorder did not name itself are never removed.
"""

import contextlib
import fcntl
import re
import shutil
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path

from common.freshness import NS_PER_S

MB = 1_000_000
HYSTERESIS = 1.1  # factor on the free space that is required before recording continues
RETRY_NS = 10 * NS_PER_S  # after a disk error
KEEP = ".keep"  # FILE.mcap.keep beside FILE.mcap marks it as kept
STAMP = r"\d{8}-\d{6}"
NAME = re.compile(rf"(\d{{6,9}})-{STAMP}(-latch-.+)?\.mcap")
UNNUMBERED = re.compile(rf"({STAMP})(-latch-.+?)?(?:-(\d+))?\.mcap")


@dataclass(frozen=True, slots=True)
class StoredFile:
    """A recording on the disk."""

    name: str
    size: int  # bytes
    kept: bool = False  # marked, or the recorder's latest
    written_ns: int = 0  # last time, on the wall clock: orders files without a number


def removable(files: Iterable[StoredFile], robot: str) -> list[StoredFile]:
    """Return the files that may be removed, in the order of their removal."""
    found = [(order, file) for file in files if (order := _order(file, robot))]
    found.sort(key=lambda each: each[0])
    kinds = [[file for order, file in found if order[0] is incident] for incident in (False, True)]
    return [file for kind in kinds for file in kind[:-1] if not file.kept]


def _order(file: StoredFile, robot: str) -> tuple[bool, int, int, str, int, str] | None:
    """Return whether it is an incident, and its place in time; None for a foreign name."""
    name = file.name.removeprefix(f"{robot}-")
    if name == file.name:
        return None
    if match := NAME.fullmatch(name):
        return bool(match[2]), int(match[1]), 0, "", 0, name
    if match := UNNUMBERED.fullmatch(name):
        return bool(match[2]), -1, file.written_ns, match[1], int(match[3] or 0), name
    return None


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


def in_use(path: Path) -> bool:
    """Return whether a process writes the file: its writer holds a lock."""
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


class Storage:
    """Names new files, removes old files of ``robot``, and decides when to stop recording."""

    def __init__(
        self,
        folder: Path,
        free_min: float,
        free: Callable[[Path], int] = lambda folder: shutil.disk_usage(folder).free,  # bytes
        *,
        robot: str | None = None,
    ) -> None:
        self.folder = folder
        self.has_room = True
        self.problem = ""  # why there is no room
        self._free_min = free_min
        self._free = free
        self._refused_ns: int | None = None
        self._robot = robot
        self._number = 0  # of the newest file of this process
        self._latest: dict[bool, Path] = {}  # of this process: continuous, and incident

    def check(self, now_ns: int) -> list[StoredFile]:
        """Check the free space, remove old recordings if necessary, and return the removed ones.

        After a disk error, check again only after ``RETRY_NS``.
        """
        if self._refused_ns is not None and now_ns - self._refused_ns < RETRY_NS:
            return []
        self._refused_ns = None
        removed: list[StoredFile] = []
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            left = self._free(self.folder)
            if left < self._free_min and self._robot is not None:
                removed = self._make_room(self._robot, left)
                left = self._free(self.folder)
        except OSError as error:
            self.on_error(error, now_ns)
            return removed
        enough = self.has_room or bool(removed)
        self.has_room = left >= self._free_min * (1.0 if enough else HYSTERESIS)
        if not self.has_room:
            wanted = self._free_min / MB
            self.problem = f"{left / MB:.0f} MB are left, recorder.free is {wanted:.0f}"
        return removed

    def on_error(self, error: OSError, now_ns: int) -> None:
        """Stop recording after a disk error."""
        self._refused_ns = now_ns
        self.has_room = False
        self.problem = f"{self.folder}: {error.strerror or error}"

    def new_path(self, robot: str, wall_ns: int, reason: str = "") -> Path:
        """Return an unused path, named by robot, number, UTC and reason."""
        stamp = time.strftime("%Y%m%d-%H%M%S", time.gmtime(wall_ns / NS_PER_S))
        names = (path.name.removeprefix(f"{robot}-") for path in self.folder.glob("*.mcap"))
        taken = [int(match[1]) for match in map(NAME.fullmatch, names) if match]
        self._number = max((*taken, self._number)) + 1
        stem = "-".join(part for part in (robot, f"{self._number:06d}", stamp, reason) if part)
        path = self._latest[bool(reason)] = self.folder / f"{stem}.mcap"
        return path

    def _make_room(self, robot: str, left: float) -> list[StoredFile]:
        """Remove the files that ``to_remove`` selects; skip those that cannot be removed."""
        needed, wanted = (self._free_min * factor - left for factor in (1.0, HYSTERESIS))
        removed = []
        for each in to_remove(self._stored(), robot, needed, wanted):
            with contextlib.suppress(OSError):
                (self.folder / each.name).unlink(missing_ok=True)
                removed.append(each)
        return removed

    def _stored(self) -> Iterator[StoredFile]:
        for path in self.folder.glob("*.mcap"):
            with contextlib.suppress(OSError):  # removed meanwhile, or not readable
                marked = path.with_name(path.name + KEEP).exists()
                kept = marked or path in self._latest.values() or in_use(path)
                about = path.stat()
                yield StoredFile(path.name, about.st_size, kept, about.st_mtime_ns)
