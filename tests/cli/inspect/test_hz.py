"""Statistics of streams."""

import msgspec
import pytest

from cli.inspect import hz
from cli.inspect.hz import StreamStats
from common.freshness import NS_PER_S
from t2.codec import Sample


def sample(message: object, received_ns: int = 15, padding: int = 0) -> Sample:
    payload = msgspec.msgpack.encode(message)
    raw = b"x" * (padding - len(payload)) if padding else b"raw"
    return Sample("t2/v1/001/tel/x", payload, "", False, raw, received_ns, 20)


def at(seconds: float, seq: int | None = None, boot: int = 1, size: int = 30) -> Sample:
    """Return a sample of that size that was received at that time."""
    message = {"boot": boot} | ({} if seq is None else {"seq": seq})
    return sample(message, round(seconds * NS_PER_S), size)


def measured(*samples: Sample) -> StreamStats:
    stats = StreamStats()
    for each in samples:
        stats.add(each)
    return stats


def test_rate_gaps_and_bandwidth() -> None:
    figures = measured(at(0.0, 1, size=500), at(0.1, 2, size=100), at(0.4, 3, size=300)).figures()
    assert (figures["hz"], figures["lost"]) == (pytest.approx(5.0), 0)
    assert (figures["gap_min"], figures["gap_max"]) == (pytest.approx(0.1), pytest.approx(0.3))
    assert (figures["bytes_per_s"], figures["bytes"]) == (pytest.approx(1000.0), 300.0)


@pytest.mark.parametrize("samples", [(), (at(1.0, 1),), (at(1.0), at(1.0))])
def test_without_a_span_there_is_no_rate(samples: tuple[Sample, ...]) -> None:
    figures = measured(*samples).figures()
    assert (figures["hz"], figures["bytes_per_s"], figures["delay_p50"]) == (None, None, None)


def test_losses_are_counted_per_sender() -> None:
    stats = measured(at(0, 1), at(1, 2), at(2, 5), at(3, 1, boot=2), at(4, 3, boot=2), at(5, None))
    assert stats.lost == 2 + 1
    assert measured(at(0, 5), at(1, 3)).lost == 0  # a number that decreases is not a loss


def test_the_window_limits_the_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hz, "WINDOW", 3)
    stats = measured(*(at(second) for second in (0, 10, 11, 12)))
    assert stats.figures()["hz"] == pytest.approx(1.0)


def test_delays_by_the_wall_clocks() -> None:
    figures = measured(*(sample({"t_ns": t_ns}) for t_ns in (19, 16, 18, 17))).figures()
    assert [figures[f"delay_{part}"] for part in ("p50", "p99", "max")] == [3e-9, 4e-9, 4e-9]
    assert measured(sample(b"x")).figures()["bytes"] == 3 + len(b"raw")
