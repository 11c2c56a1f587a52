"""Reading of complete, truncated and damaged files."""

from pathlib import Path

import pytest
from mcap.reader import make_reader

from common.freshness import NS_PER_S
from common.settings import Vehicle
from services.recorder.mcap_codec import Encoder, Entry
from services.recorder.reader import Reader
from services.recorder.writer import RecordingWriter
from t2.errors import T2Error
from t2.messages import Odometry, Velocity
from tests.recorder import samples
from tests.recorder.samples import BEGIN_NS, bare, sample

ENCODER = Encoder(Vehicle())
CHUNKS, EACH = 5, 20


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A complete file of a few chunks."""
    made = RecordingWriter(tmp_path / "a.mcap", ENCODER)
    for number in range(CHUNKS * EACH):
        made.write(
            sample("tel/bridge/velocity", samples.velocity(number, number), number / 50, b"frame")
        )
        if number % EACH == EACH - 1:
            made.flush()
    made.close()
    return made.path


def read(path: Path) -> tuple[list[Entry], Reader]:
    with Reader(path) as reader:
        return list(reader), reader


def test_read_what_was_written(path: Path) -> None:
    found, reader = read(path)
    assert [each.sample.raw for each in found] == [b"frame"] * CHUNKS * EACH
    assert [each.message for each in found] == [
        samples.velocity(number, number) for number in range(CHUNKS * EACH)
    ]
    assert {(each.key, each.kind) for each in found} == {
        ("t2/v1/001/tel/bridge/velocity", "Velocity")
    }
    assert [each.log_ns for each in found[:2]] == [BEGIN_NS, BEGIN_NS + NS_PER_S // 50]
    assert (reader.cut, reader.damaged) == (False, 0)


def test_files_have_an_index_and_view_topics(tmp_path: Path) -> None:
    made = RecordingWriter(tmp_path / "a.mcap", ENCODER)
    made.write(sample("tel/odom/odometry", samples.odometry()))
    made.write(bare("tel/mine", b"\x80"))
    made.close()
    with made.path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    schemas = {
        channel.topic: summary.schemas[channel.schema_id].name if channel.schema_id else ""
        for channel in summary.channels.values()
    }
    assert schemas == {
        "t2/v1/001/tel/odom/odometry": "t2.v1.Odometry",
        "t2/v1/001/tel/mine": "",
        "foxglove/tf": "foxglove.FrameTransform",
    }
    found, _ = read(made.path)
    assert [each.kind for each in found] == ["Odometry", ""]
    assert isinstance(found[0].message, Odometry)
    assert found[1].message is None


def test_a_truncated_file_is_readable_up_to_the_truncation(path: Path, tmp_path: Path) -> None:
    whole, part = path.read_bytes(), tmp_path / "part.mcap"
    counts = []
    for end in range(200, len(whole) - 8, 97):
        part.write_bytes(whole[:end])
        found, reader = read(part)
        assert reader.cut
        assert [each.message.seq for each in found if each.message] == list(range(len(found)))
        assert len(found) % EACH == 0
        counts.append(len(found))
    assert counts == sorted(counts)
    assert {0, EACH, CHUNKS * EACH} <= set(counts)


def test_a_damaged_chunk_is_skipped(path: Path) -> None:
    whole = bytearray(path.read_bytes())
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    second = summary.chunk_indexes[1]
    whole[second.chunk_start_offset + second.chunk_length - 20] ^= 0x55
    path.write_bytes(whole)
    found, reader = read(path)
    assert len(found) == (CHUNKS - 1) * EACH
    assert (reader.cut, reader.damaged) == (False, 1)


@pytest.mark.parametrize("content", [b"", b"\x89MCAP", b"no such file at all", b"\x00" * 99])
def test_other_files_are_rejected(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(T2Error, match=r"x\.mcap: is not an MCAP file"):
        read(path)


def test_log_times_ignore_clock_steps(tmp_path: Path) -> None:
    made = RecordingWriter(tmp_path / "a.mcap", ENCODER)
    first, second = (sample("tel/x", samples.velocity(), at_s) for at_s in (0.0, 1.0))
    made.write(first)
    stepped = {name: getattr(second, name) for name in second.__struct_fields__} | {"wall_ns": 5}
    made.write(type(second)(**stepped))
    made.close()
    assert [each.log_ns for each in read(made.path)[0]] == [BEGIN_NS, BEGIN_NS + NS_PER_S]


def test_an_invalid_message_is_none(tmp_path: Path) -> None:
    made = RecordingWriter(tmp_path / "a.mcap", ENCODER)
    it = sample("tel/bridge/velocity", samples.velocity())
    made.write(bare("tel/bridge/velocity", b"\x80", it.encoding))
    made.close()
    (found,), _ = read(made.path)
    assert (found.kind, found.message, found.sample.payload) == (Velocity.__name__, None, b"\x80")
