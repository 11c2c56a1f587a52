"""The sensors' greatest reading: shared for a second, exceeded by none."""

import math

import pytest

from services.safety.saturation import SHARED_SAMPLES, Saturation

SHARED = (3.0, 0.5, 3.001, 0.0)


def after(saturation: Saturation, *samples: tuple[float, ...], times: int = 1) -> Saturation:
    for _ in range(times):
        for sample in samples:
            saturation = saturation.after(sample)
    return saturation


KNOWN = after(Saturation(), SHARED, times=SHARED_SAMPLES)


def test_it_takes_a_second_of_sharing() -> None:
    assert after(Saturation(), SHARED, times=SHARED_SAMPLES - 1).reading is None
    assert KNOWN.reading == 3.001
    assert SHARED_SAMPLES == 20


@pytest.mark.parametrize(
    "other",
    [(3.0, 0.5, 0.7, 0.0), (3.0, 0.5, 3.0, 4.0), (3.0, 3.0, 3.0, math.inf), (2.9, 2.9, 0.5, 0.5)],
)
def test_anything_else_begins_anew(other: tuple[float, ...]) -> None:
    some = after(Saturation(), SHARED, times=SHARED_SAMPLES - 1)
    assert after(some, other, SHARED).reading is None


def test_it_explains_itself_and_nothing_else() -> None:
    assert KNOWN.explains(3.0)
    assert KNOWN.explains(3.002)
    assert not KNOWN.explains(2.9995)
    assert not KNOWN.explains(3.0026)
    assert not Saturation().explains(3.0)


def test_it_is_remembered_until_a_sonar_sees_farther() -> None:
    assert after(KNOWN, (1.0, 0.5, 0.7, 0.0), (2.0, 2.0, 0.0, 0.0)).reading == 3.001
    assert after(KNOWN, (3.002, 0.5, 0.7, 0.0)).reading == 3.001
    assert after(KNOWN, (3.1, 0.5, 0.7, 0.0)).reading is None
    assert after(KNOWN, (1.0, 0.5, math.inf, 0.0)).reading is None
