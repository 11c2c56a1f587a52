"""The page itself: whole, of itself, and without trust in what came from the bus."""

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from cli.__main__ import main
from common import codec
from common.keys import ROOT
from common.sample import Sample
from common.settings import Vehicle
from services.recorder.mcap_codec import Translator
from services.recorder.writer import Recording
from tests.cli.recordings.report.drive_fixture import BEGIN_NS, drive


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A recording of the scene's drive, and of a key that is none of ours."""
    made = Recording(tmp_path / "lap.mcap", Translator(Vehicle()), {"robot": "001"})
    for key, message, at_ns in drive():
        payload, encoding = codec.encode(message), codec.encoding(type(message))
        made.write(Sample(key, payload, encoding, False, None, at_ns, at_ns))
    made.write(Sample(f"{ROOT}/001/tel/<i>", b"\xc1", "", False, None, BEGIN_NS, BEGIN_NS))
    made.close()
    return made.path


class Page(HTMLParser):
    """Collects what a browser would fetch, and the ids that are given twice."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.ids: list[str] = []
        self.tags: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        for name, value in attrs:
            fetches = name in ("src", "href", "xlink:href", "action", "data", "poster")
            if fetches and value and not value.startswith("#"):
                self.fetched.append(value)
            if name == "id" and value:
                self.ids.append(value)


def test_a_report_shows_it_all(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(file)]) == 0
    out = file.with_suffix(".html")
    assert capsys.readouterr().out == f"{out}\n"
    text = out.read_text()
    for word in (
        "asked by teleop", "allowed by safety", "measured", "The bumper was hit.", "front left",
        "tel/bridge/velocity", "request → frame", "latched", "bridge 0.1.0", "4.0 m", "a reset",
    ):  # fmt: skip
        assert word in text, word


def test_a_page_fetches_nothing_and_runs_nothing(file: Path) -> None:
    main(["report", str(file)])
    page = Page(file.with_suffix(".html").read_text())
    assert page.fetched == []
    assert "script" not in page.tags
    assert page.tags.count("svg") == 4


def test_what_came_from_the_bus_is_no_markup(file: Path) -> None:
    main(["report", str(file)])
    text = file.with_suffix(".html").read_text()
    assert "The &lt;b&gt;bumper&lt;/b&gt; was hit." in text
    assert "<i>" not in text
    assert "tel/&lt;i&gt;" in text


def test_the_figures_do_not_share_what_they_refer_to(file: Path) -> None:
    main(["report", str(file)])
    text = file.with_suffix(".html").read_text()
    named = [re.findall(r'<clipPath id="([^"]+)"', each) for each in text.split("<svg")[1:]]
    flat = [name for each in named for name in each]
    assert flat
    assert len(flat) == len(set(flat))


def test_a_recording_that_was_cut_says_so(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-200])
    assert main(["report", str(file), "--out", str(file.parent / "cut.html")]) == 0
    assert "The file has no end" in (file.parent / "cut.html").read_text()


@pytest.mark.parametrize(
    ("name", "arguments", "sentence"),
    [
        ("none.mcap", [], "none.mcap: cannot be read: No such file"),
        ("text.mcap", [], "text.mcap: is no MCAP file"),
        ("empty.mcap", [], "empty.mcap: holds no message of the bus"),
        ("lap.mcap", ["--out", "{folder}/lap.mcap"], "is the recording itself"),
        ("lap.mcap", ["--out", "{folder}/no/lap.html"], "cannot be written: No such file"),
        ("lap.mcap", ["{folder}/a.mcap", "--out", "a.html"], "and there are 2 recordings"),
    ],
)
def test_what_is_wrong_is_said(
    file: Path,
    capsys: pytest.CaptureFixture[str],
    name: str,
    arguments: list[str],
    sentence: str,
) -> None:
    folder = file.parent
    (folder / "text.mcap").write_text("These are words. " * 9)
    Recording(folder / "empty.mcap", Translator(Vehicle()), {}).close()
    before = file.read_bytes()
    words = [word.format(folder=folder) for word in arguments]
    assert main(["report", str(folder / name), *words]) == 1
    assert sentence in capsys.readouterr().err
    assert file.read_bytes() == before
