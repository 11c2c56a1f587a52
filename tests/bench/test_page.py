"""The document, from samples that are made up."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from bench import __main__ as bench
from bench import series as kept
from bench.codec import page
from bench.codec.values import FRAMES, MESSAGES
from bench.path.page import FLOOR
from bench.reaction.page import LOADS
from bench.reaction.responders import FIFO, JUDGED, LOOP, REFLEX, ZENOH
from bench.series import Measured, Series, store
from bench.telemetry.page import AGE, STREAMS
from tests.bench import growth_series, load_series, start_series

BY_FRAME = {"T2": 2000, "struct": 1000, "ctypes": 3000}
BY_MESSAGE = {"T2": 1000, "msgpack by hand": 1000, "protobuf": 500}


def made_up() -> list[Series]:
    return [
        Series(name=(name, codec, way), calls=100, samples_ns=[took * 100] * 10, note="12")
        for names, codecs in ((FRAMES, BY_FRAME), (MESSAGES, BY_MESSAGE))
        for name in names
        for codec, took in codecs.items()
        for way in ("encode", "decode")
    ]


def reaction() -> list[Series]:
    return [
        Series(name=(name, load), calls=1, samples_ns=[100_000] * 10)
        for name in (LOOP, REFLEX, JUDGED, ZENOH + FIFO)
        for load in LOADS
    ]


def path() -> list[Series]:
    return [Series(name=(FLOOR, load), calls=1, samples_ns=[100_000] * 10) for load in LOADS]


def telemetry() -> list[Series]:
    return [
        *path(),
        *(
            Series(name=(stream, AGE, load), calls=1, samples_ns=[100_000] * 10)
            for stream, *_ in STREAMS
            for load in LOADS
        ),
    ]


SERIES: dict[str, Callable[[], list[Series]]] = {
    "reaction": reaction,
    "start": partial(start_series.made_up, 200),
    "command": path,
    "telemetry": telemetry,
    "codec": made_up,
    "load": load_series.made_up,
    "growth": growth_series.made_up,
}


def keep(*names: str) -> None:
    for name in names:
        store(name, Measured(where="a day: a machine", noise="Quiet", series=SERIES[name]()))


def test_a_row_names_codec_bytes_and_times_of_both_ways() -> None:
    lines = page.blocks(made_up())["frames"].splitlines()
    figures = "1.00 | 1.00 | 1.00 | × 0.50"
    assert lines[3] == f"| velocity report | struct | 12 | {figures} | {figures} |"
    assert len(lines) == 2 + len(FRAMES) * len(BY_FRAME)


def test_what_is_slower_than_the_floor_is_named() -> None:
    blocks = page.blocks(made_up())
    assert blocks["messages_verdict"] == "T2 is nowhere slower than msgpack by hand."
    assert blocks["frames_verdict"].startswith(
        "T2 is slower than struct in 8 of 8: velocity report, encode × 2.00; "
    )


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_document_is_told_again_from_what_was_kept(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keep(*bench.PARTS)
    assert bench.main(["--again", "--out", "performance.md"]) == 0
    text = (folder / "performance.md").read_text(encoding="utf-8")
    assert "Measured on a day: a machine. Quiet. 10 samples a row" in text
    assert "| Odometry | protobuf | 12 |" in text
    assert f"| {REFLEX} | 100 | 100 | 100 | × 1.0 | 100 | 100 | 100 | × 1.0 |" in text
    for name in bench.PARTS:
        assert f"images/performance-{name}.png" in text
        assert (folder / f"images/performance-{name}.png").stat().st_size > 1000
    assert text in capsys.readouterr().out


def test_a_part_is_measured_kept_and_told(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    it = bench.PARTS["codec"]
    part = bench.Part(made_up, lambda: "struct 1.0", it.blocks, it.draw)
    monkeypatch.setitem(bench.PARTS, "codec", part)
    keep(*(name for name in bench.PARTS if name != "codec"))
    assert bench.main(["--only", "codec"]) == 0
    told = capsys.readouterr().out
    assert "; struct 1.0; 0 minutes. The machine " in told
    assert bench.main(["--again"]) == 0
    assert capsys.readouterr().out == told
    files = {f"{name}.{kind}" for name in bench.PARTS for kind in ("json.gz", "png")}
    assert {file.name for file in (folder / kept.RAW).iterdir()} == files


def test_without_samples_it_says_what_to_do(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert bench.main(["--again"]) == bench.UNMEASURED
    assert (
        f"no samples in {kept.RAW} of {', '.join(bench.PARTS)}: measure them first"
        in capsys.readouterr().err
    )
    assert not list(folder.iterdir())


def test_a_package_that_is_missing_is_named(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def lacking() -> str:
        raise ModuleNotFoundError(name="construct")

    part = bench.Part(lambda: [], lacking, lambda series: {}, lambda file, series: None)
    monkeypatch.setitem(bench.PARTS, "codec", part)
    assert bench.main(["--only", "codec"]) == bench.UNMEASURED
    assert capsys.readouterr().err == "construct is not installed: say make bench\n"


def test_who_waits_for_others_does_not_tell_of_its_own_share() -> None:
    part = bench.Part(made_up, lambda: "", lambda series: {}, lambda file, series: None, waits=True)
    assert bench.measured(part).noise.startswith("A process that only sleeps was held up for ")
