"""``t2 info``: complete and truncated files."""

from pathlib import Path

import pytest

from cli.__main__ import main
from common.settings import Vehicle
from services.recorder.mcap_codec import Encoder
from services.recorder.writer import RecordingWriter
from t2.messages import Event, Health
from tests.cli.recordings.drive_fixture import state
from tests.recorder import samples
from tests.recorder.samples import bare, sample


@pytest.fixture
def path(tmp_path: Path) -> Path:
    made = RecordingWriter(tmp_path / "a b.mcap", Encoder(Vehicle()))
    health = Health(
        service="odom", version="1.2", uptime=0, rates={}, counters={}, lateness=0, rss=0
    )
    made.write(sample("tel/odom/health", health))
    for number in range(11):
        made.write(sample("tel/bridge/velocity", samples.velocity(), number / 10, raw=b"x"))
    made.write(sample("tel/safety/state", samples.state(), 1.0))
    made.write(sample("tel/safety/state", state(True), 1.5))
    made.write(sample("evt/bridge", Event(name="contact", level="error", text="hit"), 1.5))
    made.write(bare("tel/mine", b"\xc1", at_s=2.0))
    made.close()
    return made.path


def test_the_content_of_a_recording(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(path)]) == 0
    shown = capsys.readouterr().out
    for line in (
        f"file: '{path}', {path.stat().st_size} bytes",
        "duration: 2.0 s",
        "messages: 16 on 5 keys",
        "services: odom 1.2",
        "1 messages could not be decoded.",
        "001/tel/bridge/velocity  Velocity           11  10.0     0",
        "    1.50 s  22:13:21  brake      for 0.0 s: contact: The bumper was hit.",
        "    1.50 s  22:13:21  error      bridge: contact: hit",
    ):
        assert f"\n{line}" in f"\n{shown}", shown


def test_a_truncated_file_is_summarized_up_to_its_end(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path.write_bytes(path.read_bytes()[:-20])
    assert main(["info", str(path)]) == 1
    shown = capsys.readouterr().out
    assert "The file is truncated" in shown
    assert "messages: 16 on" in shown


def test_a_missing_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(tmp_path / "gone.mcap")]) == 1
    assert "gone.mcap: cannot be read: No such file" in capsys.readouterr().err
