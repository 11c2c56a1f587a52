"""Continuous recording in files of limited size and duration."""

from common.freshness import NS_PER_S
from services.recorder.storage import MB
from services.recorder.writer import RollingWriter
from tests.recorder import samples
from tests.recorder.files_fixture import Files, at, ns


def test_a_new_file_starts_after_the_time_limit(files: Files) -> None:
    writer = RollingWriter(files.open, files.close, MB, 10 * NS_PER_S)
    writer.flush(ns(0))
    for second in range(25):
        writer.write(at(second))
        writer.flush(ns(second))
    writer.close()
    writer.close()
    assert files.read() == [
        [float(second) for second in range(12)],
        [float(second) for second in range(12, 24)],
        [24.0],
    ]


def test_a_new_file_starts_after_the_size_limit(files: Files) -> None:
    writer = RollingWriter(files.open, files.close, MB, 10 * NS_PER_S)
    big = samples.bare("tel/x", bytes(range(256)) * 4000)
    for number in range(6):
        writer.write(big)
        writer.write(samples.bare("tel/x", number.to_bytes(64, "big")))
        writer.flush(ns(0))
    writer.close()
    assert sum(len(each) for each in files.read()) == 12
    assert len(files.closed) <= 6
    assert all(path.stat().st_size < 3 * MB for path in files.closed)
