"""Percentiles of samples, and their files."""

from pathlib import Path

import pytest

from bench.series import Measured, Series, load, store


def series(*samples_ns: int) -> Series:
    return Series(name=("it",), samples_ns=samples_ns)


def test_a_percentile_is_a_sample() -> None:
    it = series(*reversed(range(1, 2001)))
    assert (it.p50_ns, it.p99_ns, it.p999_ns) == (1000, 1980, 1998)


def test_a_ratio_compares_medians() -> None:
    assert series(1, 30, 999).ratio(series(10, 20, 20)) == 1.5


def test_samples_are_stored_and_loaded(tmp_path: Path) -> None:
    kept = Measured(where="here", noise="none", series=[series(3, 1, 2)])
    file = store("part", kept, tmp_path / "deep")
    again = load("part", tmp_path / "deep")
    assert again is not None
    assert again.series[0].samples_ns == [3, 1, 2]
    assert (again.where, again.noise) == ("here", "none")
    assert file.read_bytes().startswith(b"\x1f\x8b")


def test_a_missing_file_is_none(tmp_path: Path) -> None:
    assert load("part", tmp_path) is None


def test_no_samples_have_no_percentile() -> None:
    with pytest.raises(IndexError):
        _ = series().p50_ns
