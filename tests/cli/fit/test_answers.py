"""Rates, losses, restarts and hits in synthetic streams."""

import pytest
from msgspec.structs import replace

from cli.fit.answers import answers, hits_s, restarts_s, round_trips_s
from cli.fit.streams import Streams
from common.freshness import NS_PER_S
from t2.messages import Bumper, Mileage, Velocity
from tests.factories import link

STEP_NS = NS_PER_S // 50


def velocities(*numbers: int) -> Streams:
    """Return velocities at these periods."""
    made = Streams()
    for seq, number in enumerate(numbers):
        made.add(Velocity(linear=0.0, angular=0.0, seq=seq, mono_ns=number * STEP_NS))
    return made


def test_rate_losses_and_gap() -> None:
    (found,) = answers(velocities(*range(50), *range(55, 100)))
    assert (found.stream, found.messages) == ("velocity", 95)
    assert found.rate == pytest.approx(50)
    assert found.lost == pytest.approx(5 / 99)
    assert found.longest_gap == pytest.approx(0.12)


def test_what_the_recorder_missed_is_no_loss_of_the_board() -> None:
    made = velocities(*range(100))
    made.velocities = made.velocities[:50] + made.velocities[60:]
    (found,) = answers(made)
    assert (found.lost, round(found.longest_gap, 3)) == (0.0, 0.02)


def test_a_restart_of_the_bridge_is_no_gap() -> None:
    made = velocities(*range(50), *range(90, 140))
    made.velocities = [replace(v, boot=n // 50) for n, v in enumerate(made.velocities)]
    assert answers(made)[0].lost == 0.0


def test_hits_of_the_bumper() -> None:
    pressed = [False, True, True, True, False, False, True, False, True]
    samples = [Bumper(pressed=p, mono_ns=n * STEP_NS) for n, p in enumerate(pressed)]
    assert hits_s(samples) == pytest.approx((0.04, 0.0))  # the last one has no end


def test_restarts_of_the_board() -> None:
    made = Streams()
    for number, epoch in ((0, 0), (1, 0), (41, 1)):
        made.add(Mileage(distance=0, heading=0, epoch=epoch, mono_ns=number * STEP_NS, seq=number))
    assert restarts_s(made) == pytest.approx((0.8,))


def test_round_trips() -> None:
    made = Streams()
    made.links = [replace(link(), round_trip=0.002), replace(link(), round_trip=None)]
    assert round_trips_s(made) == (0.002,)
