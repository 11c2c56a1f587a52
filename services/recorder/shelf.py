"""The folder that recordings go to, and whether its disk has room for more."""

import shutil
import time
from collections.abc import Callable
from pathlib import Path

from common.freshness import S

AGAIN = 1.1  # of the free space that must stay, until there is room again
RETRY_NS = 10 * S  # after the disk has refused


def free_bytes(folder: Path) -> int:
    """Return what the folder's disk has left for us."""
    return shutil.disk_usage(folder).free


class Shelf:
    """Names new files, and says when to stop."""

    def __init__(
        self, folder: Path, free_min: float, free: Callable[[Path], int] = free_bytes
    ) -> None:
        self.folder = folder
        self.has_room = True
        self.trouble = ""  # why there is none, in words
        self._free_min = free_min
        self._free = free
        self._refused_ns: int | None = None

    def look(self, now_ns: int) -> None:
        """See whether there is room; what the disk has refused is tried again a while later."""
        if self._refused_ns is not None and now_ns - self._refused_ns < RETRY_NS:
            return
        self._refused_ns = None
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            left = self._free(self.folder)
        except OSError as error:
            self.refused(error, now_ns)
            return
        self.has_room = left >= self._free_min * (1.0 if self.has_room else AGAIN)
        if not self.has_room:
            self.trouble = (
                f"{left / 1e6:.0f} MB are left, recorder.free is {self._free_min / 1e6:g}"
            )

    def refused(self, error: OSError, now_ns: int) -> None:
        """Take note that the disk did not take something."""
        self._refused_ns = now_ns
        self.has_room = False
        self.trouble = f"{self.folder}: {error.strerror or error}"

    def path(self, robot: str, wall_ns: int, why: str = "") -> Path:
        """Return a name that no file has: robot, UTC, and why."""
        stamp = time.strftime("%Y%m%d-%H%M%S", time.gmtime(wall_ns / S))
        stem = "-".join(part for part in (robot, stamp, why) if part)
        names = (f"{stem}{f'-{n}' if n else ''}.mcap" for n in range(1_000_000))
        return next(path for path in (self.folder / name for name in names) if not path.exists())
