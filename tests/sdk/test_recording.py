"""Reading of recordings with the client library."""

import math
from pathlib import Path

import pytest

import t2
from common.settings import Vehicle
from services.recorder.mcap_codec import Encoder
from services.recorder.writer import RecordingWriter
from t2.messages import Velocity
from tests.recorder import samples
from tests.recorder.samples import BEGIN_NS, bare, sample


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A recording with messages, a NaN and a message of another program."""
    made = RecordingWriter(tmp_path / "a.mcap", Encoder(Vehicle()))
    made.write(sample("tel/odom/odometry", samples.odometry(), 0.0))
    made.flush()
    made.write(sample("tel/bridge/velocity", samples.velocity(), 0.5, raw=b"frame"))
    made.write(sample("tel/bridge/velocity", Velocity(linear=math.nan, angular=0.0), 1.0))
    made.write(bare("tel/mine", b"\x81\xa1a\x01", at_s=2.0))
    made.close()
    return made.path


def test_the_messages_of_a_recording_have_their_types(path: Path) -> None:
    recording = t2.Recording(path)
    odometry, velocity, invalid, mine = recording
    assert isinstance(odometry.message, t2.messages.Odometry)
    assert odometry.message.x == samples.odometry().x
    assert (odometry.key, odometry.time) == ("t2/v1/001/tel/odom/odometry", BEGIN_NS / 1e9)
    assert isinstance(velocity.message, t2.messages.Velocity)
    assert isinstance(invalid.message, dict)
    assert (mine.key, mine.message) == ("t2/v1/001/tel/mine", {"a": 1})
    assert not recording.is_cut


def test_a_truncated_recording_is_read_up_to_its_end(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    recording = t2.Recording(path)
    assert [entry.key for entry in recording][:1] == ["t2/v1/001/tel/odom/odometry"]
    assert recording.is_cut


def test_a_damaged_recording_is_cut(path: Path) -> None:
    data = path.read_bytes()
    for at in range(8, len(data), 7):
        path.write_bytes(data[:at] + b"\xff" + data[at + 1 :])
        assert len(list(t2.Recording(path))) <= 4


def test_a_recording_without_a_whole_message_is_cut(path: Path) -> None:
    begin = path.read_bytes()[:200]
    for size in range(8, len(begin)):
        path.write_bytes(begin[:size])
        recording = t2.Recording(path)
        assert not list(recording)
        assert recording.is_cut


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(t2.T2Error, match="cannot be read"):
        list(t2.Recording(tmp_path / "none.mcap"))
    (tmp_path / "a.mcap").write_bytes(b"text")
    with pytest.raises(t2.T2Error, match="is not a recording"):
        list(t2.Recording(tmp_path / "a.mcap"))
