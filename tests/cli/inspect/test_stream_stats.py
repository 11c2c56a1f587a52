"""Statistics of streams."""

import msgspec
import pytest

from cli.inspect.stream_stats import StreamSample, StreamStats, quantile, stream_sample
from common.codec import Sample
from common.freshness import NS_PER_S


def measured(*samples: StreamSample, window: int = 100) -> StreamStats:
    stats = StreamStats(window)
    for sample in samples:
        stats.add(sample)
    return stats


def at(seconds: float, seq: int | None = None, boot: int = 1, size: int = 10) -> StreamSample:
    return StreamSample(round(seconds * NS_PER_S), size, seq, boot)


def test_rate_gaps_and_bandwidth() -> None:
    figures = measured(at(0.0, 1, size=500), at(0.1, 2, size=100), at(0.4, 3, size=300)).figures()
    assert (figures["hz"], figures["lost"], figures["window"]) == (pytest.approx(5.0), 0, 3)
    assert figures["gap"] == pytest.approx({"min": 0.1, "max": 0.3, "std_dev": 0.1})
    assert (figures["bytes_per_s"], figures["bytes"]) == (pytest.approx(1000.0), 300.0)


@pytest.mark.parametrize("samples", [(), (at(1.0, 1),), (at(1.0), at(1.0))])
def test_without_a_span_there_is_no_rate(samples: tuple[StreamSample, ...]) -> None:
    figures = measured(*samples).figures()
    assert (figures["hz"], figures["bytes_per_s"]) == (None, None)
    assert figures["window"] == len(samples)


def test_losses_are_counted_per_sender() -> None:
    stats = measured(at(0, 1), at(1, 2), at(2, 5), at(3, 1, boot=2), at(4, 3, boot=2), at(5, None))
    assert stats.lost == 2 + 1
    # A sequence number that decreases is not a loss.
    assert measured(at(0, 5), at(1, 3)).lost == 0


def test_the_window_limits_samples_and_not_the_count() -> None:
    stats = measured(*(at(second) for second in (0, 10, 11, 12)), window=3)
    assert stats.rate_hz() == pytest.approx(1.0)
    assert (stats.count, len(stats.samples)) == (4, 3)


def test_the_delay() -> None:
    delays = [0.001 * number for number in range(1, 101)]
    samples = [StreamSample(0, 1, delay_s=each, clock="host") for each in delays]
    figures = measured(*samples).figures()
    assert figures["delay"] == pytest.approx({"min": 0.001, "p50": 0.051, "p99": 0.1, "max": 0.1})
    assert measured(*samples).figures()["clock"] == "host"
    assert measured(at(0.0)).figures()["delay"] == dict.fromkeys(("min", "p50", "p99", "max"))


def test_quantiles() -> None:
    assert quantile([], 0.5) is None
    assert quantile([1.0], 0.99) == 1.0
    assert quantile([1.0, 2.0, 3.0, 4.0], 0.5) == 3.0


@pytest.mark.parametrize(
    ("message", "host", "delay", "clock"),
    [
        ({"mono_ns": 5, "t_ns": 7, "host": 3, "seq": 2, "boot": 4}, 3, 10, "host"),
        ({"mono_ns": 5, "t_ns": 7, "host": 3, "seq": 2, "boot": 4}, 9, 13, "wall"),
        ({"mono_ns": 5, "t_ns": 7, "host": 0, "seq": 2, "boot": 4}, 0, 13, "wall"),
        ({"seq": 2, "boot": 4}, 3, None, ""),
        ([2], 3, None, ""),
    ],
)
def test_the_clock_of_a_delay(message: object, host: int, delay: int | None, clock: str) -> None:
    payload = msgspec.msgpack.encode(message)
    sample = Sample("t2/v1/001/tel/x", payload, "", False, b"raw", 15, 20)
    measured = stream_sample(sample, host)
    assert measured.delay_s == (None if delay is None else delay / NS_PER_S)
    assert (measured.clock, measured.size) == (clock, len(payload) + 3)
    assert (measured.seq, measured.boot) == ((2, 4) if isinstance(message, dict) else (None, None))
