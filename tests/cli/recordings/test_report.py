"""The HTML page: complete, self-contained, and with escaped content."""

import re
from pathlib import Path

import pytest

from cli.__main__ import main
from common import codec
from common.codec import Sample
from common.keys import ROOT
from common.settings import Vehicle
from services.recorder.mcap_codec import Encoder
from services.recorder.writer import RecordingWriter
from tests.cli.recordings.drive_fixture import BEGIN_NS, drive


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A recording of the drive, and of an unknown key."""
    made = RecordingWriter(tmp_path / "lap.mcap", Encoder(Vehicle()), {"robot": "001"})
    for key, _, message, at_ns in drive():
        payload, encoding = codec.encode(message), codec.encoding(type(message))
        made.write(Sample(key, payload, encoding, False, None, at_ns, at_ns))
    made.write(Sample(f"{ROOT}/001/tel/<i>\u202e", b"\xc1", "", False, None, BEGIN_NS, BEGIN_NS))
    made.close()
    return made.path


def test_report_content(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(file)]) == 0
    out = file.with_suffix(".html")
    assert capsys.readouterr().out == f"{out}\n"
    text = out.read_text()
    for word in (
        "requested by teleop", "allowed by safety", "measured", "The bumper was hit.",
        "tel/bridge/velocity", "bridge 0.1.0", "4.0 m",
        "2023-11-14 22:13:20 UTC",
    ):  # fmt: skip
        assert word in text, word
    # It loads nothing, and content of the bus is escaped.
    assert not re.findall(r"<script|(?:src|href|action|data|poster)=[^#]{2}", text)
    assert text.count("<svg") == 2
    assert "<i>" not in text
    assert "tel/&lt;i&gt;\\u202e" in text
    assert text.replace("\n", "").isprintable()


def test_a_truncated_recording_has_a_warning(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-200])
    assert main(["report", str(file), "--out", str(file.parent / "cut.html")]) == 0
    assert "The file is truncated" in (file.parent / "cut.html").read_text()


@pytest.mark.parametrize(
    ("name", "arguments", "sentence"),
    [
        ("empty.mcap", [], "empty.mcap: contains no messages of the bus"),
        ("lap.mcap", ["--out", "{folder}/lap.mcap"], "is the recording itself"),
        ("lap.mcap", ["{folder}/a.mcap", "--out", "a.html"], "and there are 2 recordings"),
    ],
)
def test_error_messages(
    file: Path,
    capsys: pytest.CaptureFixture[str],
    name: str,
    arguments: list[str],
    sentence: str,
) -> None:
    folder = file.parent
    (folder / "text.mcap").write_text("These are words. " * 9)
    RecordingWriter(folder / "empty.mcap", Encoder(Vehicle()), {}).close()
    before = file.read_bytes()
    words = [word.format(folder=folder) for word in arguments]
    assert main(["report", str(folder / name), *words]) == 1
    assert sentence in capsys.readouterr().err
    assert file.read_bytes() == before
