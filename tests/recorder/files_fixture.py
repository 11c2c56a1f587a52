"""Recordings without a bus: a folder of files, and samples at a given second."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from common.freshness import NS_PER_S
from common.settings import Vehicle
from services.recorder.mcap_codec import Encoder
from services.recorder.reader import Reader
from services.recorder.storage import MB, Storage, StoredFile
from services.recorder.writer import RecordingWriter
from t2.codec import Sample
from tests.recorder import samples
from tests.recorder.samples import BEGIN_NS, MONO_NS, sample

SPAN_NS, TAIL_NS = 10 * NS_PER_S, 2 * NS_PER_S  # of the black box
OLD, MIDDLE, NEW = (f"001-00000{n}-2026010{4 - n}-000000" for n in (1, 2, 3))  # the clock fell back
UNNUMBERED = "001-20260101-000000"  # a name of an earlier version
CONTINUOUS = [f"{stamp}.mcap" for stamp in (OLD, MIDDLE, NEW)]
INCIDENTS = [f"{stamp}-latch-contact.mcap" for stamp in (OLD, MIDDLE, NEW)]


class Files:
    """Opens recordings and lists the closed ones."""

    def __init__(self, folder: Path) -> None:
        self.storage = Storage(folder, 0)
        self.closed: list[Path] = []

    def open(self, first: Sample, reason: str) -> RecordingWriter:
        path = self.storage.new_path("001", first.wall_ns, reason)
        return RecordingWriter(path, Encoder(Vehicle()))

    def close(self, recording: RecordingWriter) -> None:
        recording.close()
        self.closed.append(recording.path)

    def read(self) -> list[list[float]]:
        """Return the times of the messages in each file, in seconds."""
        return [list(times(path)) for path in self.closed]


def times(path: Path) -> Iterator[float]:
    with Reader(path) as reader:
        yield from ((each.log_ns - BEGIN_NS) / NS_PER_S for each in reader)
    assert not reader.cut


@pytest.fixture
def files(tmp_path: Path) -> Files:
    return Files(tmp_path)


def at(second: float) -> Sample:
    return sample("tel/bridge/velocity", samples.velocity(), second)


def ns(second: float) -> int:
    return MONO_NS + round(second * NS_PER_S)


def stored(*names: str, kept: tuple[str, ...] = ()) -> list[StoredFile]:
    return [StoredFile(name, MB, name in kept) for name in names]


def names(files: list[StoredFile]) -> list[str]:
    return [file.name for file in files]
