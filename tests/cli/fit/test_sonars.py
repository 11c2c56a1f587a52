"""Ranges of synthetic sonars."""

from collections.abc import Sequence

import pytest

from cli.fit.sonars import Ranges, ranges
from cli.fit.streams import Streams
from common.freshness import NS_PER_S
from t2.messages import Command, Mileage, Motion, RangeStatus, Ultrasonic, Velocity


def standing(*readings: Sequence[float | None], status: RangeStatus = "ok") -> Streams:
    """Return a standstill of samples at 20 Hz; a None has this status, or no echo."""
    made = Streams()
    missing: RangeStatus = "no_echo" if status == "ok" else status
    for number, sample in enumerate(readings):
        now_ns = 10 * NS_PER_S + number * NS_PER_S // 20
        states = tuple("ok" if one is not None else missing for one in sample)
        made.add(Ultrasonic(ranges=tuple(sample), status=states, mono_ns=now_ns, seq=number))
        made.add(Motion(command=Command.STOP, mono_ns=now_ns, seq=number))
        made.add(Velocity(linear=0.0, angular=0.0, mono_ns=now_ns, seq=number))
        made.add(Mileage(distance=0.0, heading=0.0, epoch=0, mono_ns=now_ns, seq=number))
    return made


def measured(made: Streams) -> Ranges:
    found = ranges(made)
    assert found is not None
    return found


def test_no_reading_at_all() -> None:
    assert ranges(Streams()) is None
    assert ranges(standing([None] * 8)) is None


def test_shares_and_extremes() -> None:
    found = measured(standing([1.0, 1.2, 0.4, None, 2.0, 2.0, 2.0, 2.0]))
    assert (found.readings, found.no_echo, found.faulty) == (8, 1 / 8, 0.0)
    assert (found.nearest, found.farthest) == (0.4, 2.0)
    assert found.resolution == 0.001  # too few different ones
    steps = measured(standing(*[[1.0 + n / 100] * 8 for n in range(12)]))
    assert steps.resolution == pytest.approx(0.01)
    assert measured(standing([1.0] * 7 + [None], status="fault")).faulty == 1 / 8


@pytest.mark.parametrize(
    ("sonars", "samples", "ends"), [(2, 20, True), (1, 40, False), (8, 19, False)]
)
def test_where_the_sonars_end(sonars: int, samples: int, ends: bool) -> None:
    """Two of them give one greatest reading at least 20 times."""
    sample = [3.0] * sonars + [1.5] * 7
    made = standing(*[sample[:8] if n < samples else [1.0 + n / 100] * 8 for n in range(60)])
    found = measured(made).ends
    if not ends:
        assert found is None or len(set(found.values)) > 1
        return
    assert found is not None
    assert found.setting == "vehicle.sonar_max"
    assert max(found.values) == pytest.approx(3.0)


def test_noise_and_single_near_readings_at_standstill() -> None:
    made = standing(*[[2.0 + 0.01 * (-1) ** n] * 8 for n in range(60)])
    found = measured(made)
    assert found.noise is not None
    assert found.noise.mean == pytest.approx(0.01, rel=0.03)
    assert found.jumps == 0
    made = standing(*[[2.0 if n != 40 else 1.0] * 8 for n in range(60)])
    assert measured(made).jumps == pytest.approx(8 / (8 * 50), rel=0.1)
