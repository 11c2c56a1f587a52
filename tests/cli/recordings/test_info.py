"""``t2 info``: complete and truncated files, as text and as JSON."""

import json
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from cli.__main__ import main
from common.messages import Event, Health
from common.settings import Vehicle
from services.recorder.mcap_codec import Encoder
from services.recorder.writer import RecordingWriter
from tests.cli.recordings import drive_fixture
from tests.recorder import samples
from tests.recorder.samples import BEGIN_NS, ROOT, bare, sample


@pytest.fixture
def path(tmp_path: Path) -> Path:
    about = {"robot": "007", "version": "1.2.3", "why": "latch-contact"}
    made = RecordingWriter(tmp_path / "a.mcap", Encoder(Vehicle()), about)
    health = Health(
        service="odom", version="1.2", uptime=0, rates={}, counters={}, lateness=0, rss=0
    )
    made.write(sample("tel/odom/health", health))
    for number in range(11):
        made.write(sample("tel/bridge/velocity", samples.velocity(), number / 10, raw=b"x"))
    made.write(sample("tel/safety/state", samples.state(), 1.0))
    made.flush()
    made.write(sample("tel/safety/state", drive_fixture.state(True), 1.5))
    made.write(sample("evt/bridge", Event(name="contact", level="error", text="hit"), 1.5))
    made.write(bare("tel/mine", b"\xc1", at_s=2.0))
    made.close()
    return made.path


def as_json(capsys: pytest.CaptureFixture[str], path: Path) -> tuple[int, dict[str, Any]]:
    code = main(["info", "--json", str(path)])
    printed: dict[str, Any] = json.loads(capsys.readouterr().out)
    return code, printed


def test_json_output(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, printed = as_json(capsys, path)
    assert code == 0
    assert printed["keys"][f"{ROOT}/tel/bridge/velocity"] == {
        "type": "Velocity", "count": 11, "hz": pytest.approx(10.0), "lost": 0, "faulty": 0,
    }  # fmt: skip
    assert printed["keys"][f"{ROOT}/tel/mine"]["type"] == ""
    assert (printed["cut"], printed["damaged_chunks"], printed["bytes"]) == (
        False,
        0,
        printed["readable"],
    )
    assert (printed["begin_ns"], printed["duration"], printed["messages"]) == (BEGIN_NS, 2.0, 16)
    assert printed["about"]["robot"] == "007"
    assert printed["versions"] == {"odom": "1.2"}
    event = {"at": 1.5, "who": "bridge", "level": "error", "text": "contact: hit"}
    assert printed["events"] == [event]
    assert printed["stops"] == [
        {"at": 1.5, "seconds": 0.0, "verdict": "brake", "latched": ["contact"],
         "reasons": {"contact": "The bumper was hit."}}
    ]  # fmt: skip


def test_a_truncated_file_is_summarized_up_to_its_end(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    second = summary.chunk_indexes[1]
    path.write_bytes(path.read_bytes()[: second.chunk_start_offset + second.chunk_length // 2])
    code, printed = as_json(capsys, path)
    assert code == 1
    assert printed["cut"]
    assert 0 < printed["readable"] <= printed["bytes"]
    assert printed["messages"] == 13
    assert main(["info", str(path)]) == 1
    assert f"truncated, {printed['readable']} bytes are readable" in capsys.readouterr().out


def test_text_output(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(path)]) == 0
    shown = capsys.readouterr().out
    for message in (
        "complete", "robot 007, recorded by T2 1.2.3", "reason: latch-contact",
        "16 messages in 2.0 s",
        "versions: odom 1.2", "001/tel/bridge/velocity", "10.0", "stops:",
        "events:", "contact: hit",
        "1.50 s  brake      for 0.0 s: contact: The bumper was hit.",
    ):  # fmt: skip
        assert message in shown, message


def test_a_missing_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(tmp_path / "gone.mcap")]) == 1
    assert "gone.mcap: cannot be read: No such file" in capsys.readouterr().err
