"""Rates, delays and bandwidths."""

import pytest

from cli.inspect.stream_stats import Meter, Taken, quantile
from common.freshness import NS_PER_S


def metered(*samples: Taken, window: int = 100) -> Meter:
    meter = Meter(window)
    for sample in samples:
        meter.take(sample)
    return meter


def at(seconds: float, seq: int | None = None, boot: int = 1, size: int = 10) -> Taken:
    return Taken(round(seconds * NS_PER_S), size, seq, boot)


def test_the_rate_and_the_gaps() -> None:
    told = metered(at(0.0, 1), at(0.1, 2), at(0.4, 3)).rate()
    assert told == {
        "hz": pytest.approx(5.0), "min": pytest.approx(0.1), "max": pytest.approx(0.3),
        "std_dev": pytest.approx(0.1), "lost": 0, "window": 3,
    }  # fmt: skip


@pytest.mark.parametrize("samples", [(), (at(1.0, 1),)])
def test_less_than_two_have_no_rate(samples: tuple[Taken, ...]) -> None:
    told = metered(*samples).rate()
    assert (told["hz"], told["min"], told["max"], told["std_dev"]) == (None,) * 4
    assert told["window"] == len(samples)


def test_two_at_one_moment_have_no_rate() -> None:
    assert metered(at(1.0), at(1.0)).rate()["hz"] is None


def test_what_is_lost_is_counted_for_each_sender() -> None:
    meter = metered(at(0, 1), at(1, 2), at(2, 5), at(3, 1, boot=2), at(4, 3, boot=2), at(5, None))
    assert meter.lost == 2 + 1
    # A sequence that goes back is no loss.
    assert metered(at(0, 5), at(1, 3)).lost == 0


def test_the_window_forgets_and_the_count_does_not() -> None:
    meter = metered(*(at(second) for second in (0, 10, 11, 12)), window=3)
    assert meter.rate()["hz"] == pytest.approx(1.0)
    assert (meter.count, len(meter.taken)) == (4, 3)


def test_the_delay() -> None:
    delays = [0.001 * number for number in range(1, 101)]
    told = metered(*(Taken(0, 1, delay_s=each, clock="host") for each in delays)).delay()
    assert told["mean"] == pytest.approx(0.0505)
    assert (told["min"], told["max"]) == (0.001, 0.1)
    assert told["p50"] == pytest.approx(0.051)
    assert told["p99"] == 0.1
    assert (told["clock"], told["window"]) == ("host", 100)


def test_no_delay_without_a_stamp() -> None:
    told = metered(at(0.0), at(1.0)).delay()
    assert (told["mean"], told["p99"], told["clock"], told["window"]) == (None, None, None, 0)


def test_the_bandwidth() -> None:
    told = metered(at(0.0, size=500), at(0.5, size=100), at(2.0, size=300)).bandwidth()
    assert told == {"bytes_per_s": 200.0, "mean": 300.0, "min": 100, "max": 500, "window": 3}


def test_the_bandwidth_of_one_and_of_none() -> None:
    assert metered(at(1.0)).bandwidth()["bytes_per_s"] is None
    assert metered().bandwidth() == {
        "bytes_per_s": None, "mean": None, "min": None, "max": None, "window": 0,
    }  # fmt: skip


def test_quantiles() -> None:
    assert quantile([], 0.5) is None
    assert quantile([1.0], 0.99) == 1.0
    assert quantile([1.0, 2.0, 3.0, 4.0], 0.5) == 3.0
