"""Statistics of streams."""

import pytest

from cli.inspect.stream_stats import StreamSample, StreamStats, quantile
from common.freshness import NS_PER_S


def measured(*samples: StreamSample, window: int = 100) -> StreamStats:
    stats = StreamStats(window)
    for sample in samples:
        stats.add(sample)
    return stats


def at(seconds: float, seq: int | None = None, boot: int = 1, size: int = 10) -> StreamSample:
    return StreamSample(round(seconds * NS_PER_S), size, seq, boot)


def test_the_rate_and_the_gaps() -> None:
    figures = measured(at(0.0, 1), at(0.1, 2), at(0.4, 3)).rate()
    assert figures == {
        "hz": pytest.approx(5.0), "min": pytest.approx(0.1), "max": pytest.approx(0.3),
        "std_dev": pytest.approx(0.1), "lost": 0, "window": 3,
    }  # fmt: skip


@pytest.mark.parametrize("samples", [(), (at(1.0, 1),)])
def test_fewer_than_two_samples_have_no_rate(samples: tuple[StreamSample, ...]) -> None:
    figures = measured(*samples).rate()
    assert (figures["hz"], figures["min"], figures["max"], figures["std_dev"]) == (None,) * 4
    assert figures["window"] == len(samples)


def test_two_simultaneous_samples_have_no_rate() -> None:
    assert measured(at(1.0), at(1.0)).rate()["hz"] is None


def test_losses_are_counted_per_sender() -> None:
    stats = measured(at(0, 1), at(1, 2), at(2, 5), at(3, 1, boot=2), at(4, 3, boot=2), at(5, None))
    assert stats.lost == 2 + 1
    # A sequence number that decreases is not a loss.
    assert measured(at(0, 5), at(1, 3)).lost == 0


def test_the_window_limits_samples_and_not_the_count() -> None:
    stats = measured(*(at(second) for second in (0, 10, 11, 12)), window=3)
    assert stats.rate()["hz"] == pytest.approx(1.0)
    assert (stats.count, len(stats.samples)) == (4, 3)


def test_the_delay() -> None:
    delays = [0.001 * number for number in range(1, 101)]
    figures = measured(*(StreamSample(0, 1, delay_s=each, clock="host") for each in delays)).delay()
    assert figures["mean"] == pytest.approx(0.0505)
    assert (figures["min"], figures["max"]) == (0.001, 0.1)
    assert figures["p50"] == pytest.approx(0.051)
    assert figures["p99"] == 0.1
    assert (figures["clock"], figures["window"]) == ("host", 100)


def test_no_delay_without_a_timestamp() -> None:
    figures = measured(at(0.0), at(1.0)).delay()
    assert (figures["mean"], figures["p99"], figures["clock"], figures["window"]) == (
        None,
        None,
        None,
        0,
    )


def test_the_bandwidth() -> None:
    figures = measured(at(0.0, size=500), at(0.5, size=100), at(2.0, size=300)).bandwidth()
    assert figures == {"bytes_per_s": 200.0, "mean": 300.0, "min": 100, "max": 500, "window": 3}


def test_the_bandwidth_of_one_sample_and_of_none() -> None:
    assert measured(at(1.0)).bandwidth()["bytes_per_s"] is None
    assert measured().bandwidth() == {
        "bytes_per_s": None, "mean": None, "min": None, "max": None, "window": 0,
    }  # fmt: skip


def test_quantiles() -> None:
    assert quantile([], 0.5) is None
    assert quantile([1.0], 0.99) == 1.0
    assert quantile([1.0, 2.0, 3.0, 4.0], 0.5) == 3.0
