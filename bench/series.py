"""Samples of a row with their percentiles, and the raw files in ``out/bench``."""

import gzip
from collections.abc import Sequence
from pathlib import Path

import msgspec
from msgspec import Struct

from verification.harness.results import percentile

RAW = Path("out/bench")


class Series(Struct, frozen=True, kw_only=True):
    """The samples of one row."""

    name: tuple[str, ...]
    samples_ns: Sequence[int]
    note: str = ""  # remark on the row

    def percentile_ns(self, share: float) -> float:
        """Return the percentile of a share (nearest rank), in ns."""
        return percentile(self.samples_ns, share)

    @property
    def p50_ns(self) -> float:
        """Median, in ns."""
        return self.percentile_ns(0.5)

    @property
    def p99_ns(self) -> float:
        """99th percentile, in ns."""
        return self.percentile_ns(0.99)

    @property
    def p999_ns(self) -> float:
        """99.9th percentile, in ns."""
        return self.percentile_ns(0.999)

    def ratio(self, other: "Series") -> float:
        """Return this median divided by the other median."""
        return self.p50_ns / other.p50_ns


class Measured(Struct, frozen=True, kw_only=True):
    """The result of one benchmark."""

    where: str  # date, machine, Python, versions
    noise: str  # other load on the machine
    series: Sequence[Series]


def store(benchmark: str, measured: Measured, folder: Path = RAW) -> Path:
    """Write all samples of a benchmark, compressed; return the file."""
    folder.mkdir(parents=True, exist_ok=True)
    file = _file(benchmark, folder)
    file.write_bytes(gzip.compress(msgspec.json.encode(measured)))
    return file


def load(benchmark: str, folder: Path = RAW) -> Measured | None:
    """Return the last stored result of a benchmark, or None."""
    file = _file(benchmark, folder)
    if not file.exists():
        return None
    return msgspec.json.decode(gzip.decompress(file.read_bytes()), type=Measured)


def _file(benchmark: str, folder: Path) -> Path:
    return folder / f"{benchmark}.json.gz"
