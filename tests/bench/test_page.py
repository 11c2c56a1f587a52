"""The document, from made-up samples."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from bench import __main__ as bench
from bench import series as kept
from bench.path.page import FLOOR
from bench.reaction.responders import JUDGED, LOADS, LOOP, REFLEX
from bench.series import Measured, Series, store
from bench.telemetry.page import AGE, STREAMS
from tests.bench import growth_series, load_series, start_series


def reaction() -> list[Series]:
    return [
        Series(name=(name, load), samples_ns=[100_000] * 10)
        for name in (LOOP, REFLEX, JUDGED)
        for load in LOADS
    ]


def path() -> list[Series]:
    return [Series(name=(FLOOR, load), samples_ns=[100_000] * 10) for load in LOADS]


def telemetry() -> list[Series]:
    return [
        *path(),
        *(
            Series(name=(stream, AGE, load), samples_ns=[100_000] * 10)
            for stream, *_ in STREAMS
            for load in LOADS
        ),
    ]


SERIES: dict[str, Callable[[], list[Series]]] = {
    "reaction": reaction,
    "start": partial(start_series.made_up, 200),
    "command": path,
    "telemetry": telemetry,
    "load": load_series.made_up,
    "growth": growth_series.made_up,
}


def store_made_up(*names: str) -> None:
    for name in names:
        store(name, Measured(where="a day: a machine", noise="Quiet", series=SERIES[name]()))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.campaign
def test_the_document_is_printed_again_from_stored_samples(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store_made_up(*bench.BENCHMARKS)
    assert bench.main(["--again", "--out", "performance.md"]) == 0
    text = (folder / "performance.md").read_text(encoding="utf-8")
    assert "Measured on a day: a machine. Quiet. 10 round trips a row" in text
    assert f"| {REFLEX} | 100 | 100 | 100 | × 1.0 | 100 | 100 | 100 | × 1.0 | 4 of 4 re" in text
    assert "images/performance-reaction.png" in text
    assert (folder / "images/performance-reaction.png").stat().st_size > 1000
    questions = [name for each in bench.BENCHMARKS.values() for name in each.questions]
    assert all(f"\n## {question}\n" in text for question in questions)
    assert text in capsys.readouterr().out


@pytest.mark.campaign
def test_a_benchmark_is_measured_stored_and_printed(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    it = bench.BENCHMARKS["command"]
    made = bench.Benchmark(path, lambda: "a bus 1.0", it.blocks, it.questions)
    monkeypatch.setitem(bench.BENCHMARKS, "command", made)
    store_made_up(*(name for name in bench.BENCHMARKS if name != "command"))
    assert bench.main(["--only", "command"]) == 0
    printed = capsys.readouterr().out
    assert "; a bus 1.0; 0 minutes. A sleeping process was stalled for at most " in printed
    assert bench.main(["--again"]) == 0
    assert capsys.readouterr().out == printed
    files = {f"{name}.json.gz" for name in bench.BENCHMARKS} | {"reaction.png"}
    assert {file.name for file in (folder / kept.RAW).iterdir()} == files


def test_without_samples_the_error_names_the_benchmarks(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert bench.main(["--again"]) == bench.UNMEASURED
    assert (
        f"no samples in {kept.RAW} of {', '.join(bench.BENCHMARKS)}: measure them first"
        in capsys.readouterr().err
    )
    assert not list(folder.iterdir())


def test_a_missing_package_is_named(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def lacking() -> str:
        raise ModuleNotFoundError(name="cyclonedds")

    made = bench.Benchmark(lambda: [], lacking, lambda series: {}, {})
    monkeypatch.setitem(bench.BENCHMARKS, "command", made)
    assert bench.main(["--only", "command"]) == bench.UNMEASURED
    assert capsys.readouterr().err == "cyclonedds is not installed; run make bench\n"
