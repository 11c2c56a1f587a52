"""What was measured of one row, and what it comes to. Pure, but for ``store`` and ``load``."""

import gzip
from collections.abc import Sequence
from pathlib import Path

import msgspec
from msgspec import Struct

from verification.faults.table import rank

RAW = Path("out/bench")


class Series(Struct, frozen=True, kw_only=True):
    """The samples of one row; a sample is so many calls, one after the other."""

    name: tuple[str, ...]
    calls: int
    samples_ns: Sequence[int]  # each for all its calls
    note: str = ""  # what is said of the row besides

    def call_ns(self, share: float) -> float:
        """Return how long a call took in the sample that this share does not exceed, in ns."""
        return rank(self.samples_ns, share) / self.calls

    @property
    def p50_ns(self) -> float:
        """Return the median, in ns a call."""
        return self.call_ns(0.5)

    @property
    def p99_ns(self) -> float:
        """Return what 99 % do not exceed, in ns a call."""
        return self.call_ns(0.99)

    @property
    def p999_ns(self) -> float:
        """Return what 99.9 % do not exceed, in ns a call."""
        return self.call_ns(0.999)

    def ratio(self, other: "Series") -> float:
        """Return how many times as long as the other's its median is."""
        return self.p50_ns / other.p50_ns


class Measured(Struct, frozen=True, kw_only=True):
    """What a part measured, and where."""

    where: str  # date, machine, Python, versions
    noise: str  # what else the machine did meanwhile
    series: Sequence[Series]


def store(part: str, measured: Measured, folder: Path = RAW) -> Path:
    """Keep all samples of a part, compressed; return where."""
    folder.mkdir(parents=True, exist_ok=True)
    file = _file(part, folder)
    file.write_bytes(gzip.compress(msgspec.json.encode(measured)))
    return file


def load(part: str, folder: Path = RAW) -> Measured | None:
    """Return what was measured of a part the last time, or nothing."""
    file = _file(part, folder)
    if not file.exists():
        return None
    return msgspec.json.decode(gzip.decompress(file.read_bytes()), type=Measured)


def _file(part: str, folder: Path) -> Path:
    return folder / f"{part}.json.gz"
