"""The folder that recordings go to, and whether its disk has room for more."""

import contextlib
import fcntl
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from common.freshness import NS_PER_S
from services.recorder.retention import KEEP, Stored, to_remove

AGAIN = 1.1  # of the free space that must stay, until there is room again
RETRY_NS = 10 * NS_PER_S  # after the disk has refused


def free_bytes(folder: Path) -> int:
    """Return what the folder's disk has left for us."""
    return shutil.disk_usage(folder).free


def in_use(path: Path) -> bool:
    """Return whether a process is writing this recording: it holds a lock on it."""
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


class Shelf:
    """Names new files, removes old ones of ``robot`` to make room, decides when to stop."""

    def __init__(
        self,
        folder: Path,
        free_min: float,
        free: Callable[[Path], int] = free_bytes,
        *,
        robot: str | None = None,
    ) -> None:
        self.folder = folder
        self.has_room = True
        self.trouble = ""  # why there is none, in words
        self._free_min = free_min
        self._free = free
        self._refused_ns: int | None = None
        self._robot = robot
        self._latest: dict[bool, Path] = {}  # that this process began: continuous, and incident

    def look(self, now_ns: int) -> list[Stored]:
        """Check for room, make some if necessary, and return what was removed for it.

        After an error of the disk it tries again later.
        """
        if self._refused_ns is not None and now_ns - self._refused_ns < RETRY_NS:
            return []
        self._refused_ns = None
        removed: list[Stored] = []
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            left = self._free(self.folder)
            if left < self._free_min and self._robot is not None:
                removed = self._make_room(self._robot, left)
                left = self._free(self.folder)
        except OSError as error:
            self.refused(error, now_ns)
            return removed
        enough = self.has_room or bool(removed)
        self.has_room = left >= self._free_min * (1.0 if enough else AGAIN)
        if not self.has_room:
            self.trouble = (
                f"{left / 1e6:.0f} MB are left, recorder.free is {self._free_min / 1e6:g}"
            )
        return removed

    def refused(self, error: OSError, now_ns: int) -> None:
        """Take note that the disk did not take something."""
        self._refused_ns = now_ns
        self.has_room = False
        self.trouble = f"{self.folder}: {error.strerror or error}"

    def path(self, robot: str, wall_ns: int, why: str = "") -> Path:
        """Return a name that no file has: robot, UTC, and why."""
        stamp = time.strftime("%Y%m%d-%H%M%S", time.gmtime(wall_ns / NS_PER_S))
        stem = "-".join(part for part in (robot, stamp, why) if part)
        names = (f"{stem}{f'-{n}' if n else ''}.mcap" for n in range(1_000_000))
        path = next(path for path in (self.folder / name for name in names) if not path.exists())
        self._latest[bool(why)] = path
        return path

    def _make_room(self, robot: str, left: float) -> list[Stored]:
        """Remove what ``retention`` names; a file that cannot be removed is left."""
        needed, wanted = (self._free_min * factor - left for factor in (1.0, AGAIN))
        removed = []
        for each in to_remove(self._stored(), robot, needed, wanted):
            with contextlib.suppress(OSError):
                (self.folder / each.name).unlink(missing_ok=True)
                removed.append(each)
        return removed

    def _stored(self) -> Iterator[Stored]:
        for path in self.folder.glob("*.mcap"):
            with contextlib.suppress(OSError):  # gone meanwhile, or not ours to read
                marked = path.with_name(path.name + KEEP).exists()
                kept = marked or path in self._latest.values() or in_use(path)
                yield Stored(path.name, path.stat().st_size, kept)
