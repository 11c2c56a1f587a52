"""The HTML page: complete, self-contained, and with escaped content."""

import re
from pathlib import Path

import pytest

from cli.__main__ import main
from common.freshness import NS_PER_S
from common.settings import Vehicle
from services.recorder.mcap_codec import Encoder
from services.recorder.writer import RecordingWriter
from tests.cli.recordings.drive_fixture import drive, in_the_map
from tests.recorder.samples import BEGIN_NS, ROOT, bare, sample


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A recording of the drive, and of an unknown key."""
    made = RecordingWriter(tmp_path / "lap.mcap", Encoder(Vehicle()))
    for key, _, message, at_ns in (*drive(), *in_the_map()):
        at_s = (at_ns - BEGIN_NS) / NS_PER_S
        made.write(sample(key.removeprefix(f"{ROOT}/"), message, at_s))
    made.write(bare("tel/<i>\u202e", b"\xc1"))
    made.close()
    return made.path


def test_report_content(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(file)]) == 0
    out = file.with_suffix(".html")
    assert capsys.readouterr().out == f"{out}\n"
    text = out.read_text()
    for word in (
        "requested by teleop", "allowed by safety", "measured", "The bumper was hit.",
        "tel/bridge/velocity", "bridge 0.1.0", "4.0 m", "2023-11-14 22:13:20 UTC",
        "Path in the map", "placed 1.6 s, lost 0.4 s, fixes: 1 used, 1 refused",
    ):  # fmt: skip
        assert word in text, word
    assert re.search(r'<td class="n">22:13:\d\d</td>', text)  # of a stop
    assert '<td class="bad">The &lt;b&gt;bumper&lt;/b&gt; was hit.</td>' in text  # of an event
    # It loads nothing, and content of the bus is escaped.
    assert not re.findall(r"<script|(?:src|href|action|data|poster)=[^#]{2}", text)
    assert text.count("<svg") == 3
    assert "<i>" not in text
    assert "tel/&lt;i&gt;\\u202e" in text
    assert text.replace("\n", "").isprintable()


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["empty.mcap"], "empty.mcap: contains no messages of the bus"),
        (["lap.mcap", "--out", "lap.mcap"], "is the recording itself"),
        (["lap.mcap", "empty.mcap", "--out", "a.html"], "and there are 2 recordings"),
    ],
)
def test_error_messages(
    file: Path,
    words: list[str],
    sentence: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(file.parent)
    RecordingWriter(Path("empty.mcap"), Encoder(Vehicle())).close()
    before = file.read_bytes()
    assert main(["report", *words]) == 1
    assert sentence in capsys.readouterr().err
    assert file.read_bytes() == before
