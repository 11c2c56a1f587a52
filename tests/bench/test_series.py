"""What samples come to."""

from pathlib import Path

import pytest

from bench.rounds import Row, measured
from bench.series import Measured, Series, load, store


def series(*samples_ns: int, calls: int = 1) -> Series:
    return Series(name=("it",), calls=calls, samples_ns=samples_ns)


def test_a_percentile_is_a_sample_that_this_share_does_not_exceed() -> None:
    it = series(*reversed(range(1, 2001)))
    assert (it.p50_ns, it.p99_ns, it.p999_ns) == (1000, 1980, 1998)


def test_a_sample_is_divided_by_its_calls() -> None:
    assert series(700, 100, 400, calls=100).p50_ns == 4


def test_a_ratio_is_that_of_the_medians() -> None:
    assert series(1, 30, 999).ratio(series(10, 20, 20)) == 1.5


def test_samples_are_kept_and_found_again(tmp_path: Path) -> None:
    kept = Measured(where="here", noise="none", series=[series(3, 1, 2, calls=7)])
    file = store("part", kept, tmp_path / "deep")
    again = load("part", tmp_path / "deep")
    assert again is not None
    assert again.series[0].samples_ns == [3, 1, 2]
    assert (again.where, again.noise, again.series[0].calls) == ("here", "none", 7)
    assert file.read_bytes().startswith(b"\x1f\x8b")


def test_what_was_never_measured_is_not_there(tmp_path: Path) -> None:
    assert load("part", tmp_path) is None


def test_rows_take_turns_in_an_order_that_changes_and_is_the_same_each_time() -> None:
    def told() -> tuple[list[str], list[Series]]:
        calls: list[str] = []
        rows = [Row((name,), lambda name=name: calls.append(name), 2) for name in "abc"]  # type: ignore[misc]
        return calls, measured(rows, rounds=6, warm_up=1)

    calls, made = told()
    rounds = ["".join(calls[at : at + 6]) for at in range(0, len(calls), 6)]
    assert len(rounds) == 7
    assert all(sorted(each) == list("aabbcc") for each in rounds)
    assert all(each[0] == each[1] and each[2] == each[3] for each in rounds)
    assert len(set(rounds)) > 1
    assert [(one.name, one.calls, len(one.samples_ns)) for one in made] == [
        (("a",), 2, 6), (("b",), 2, 6), (("c",), 2, 6),
    ]  # fmt: skip
    assert told()[0] == calls


def test_of_no_samples_there_is_no_figure() -> None:
    with pytest.raises(IndexError):
        _ = series().p50_ns
