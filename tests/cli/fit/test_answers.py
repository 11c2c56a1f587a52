"""Rates, losses, restarts and hits in synthetic streams."""

import pytest
from msgspec.structs import replace

from cli.fit.answers import answers, hits_s, order, restarts_s, round_trips_s
from cli.fit.command import of_streams
from cli.fit.streams import Streams
from common.freshness import NS_PER_S
from t2.messages import Bumper, Mileage, RangeStatus, Ultrasonic, Velocity
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


def test_jitter_is_the_spread_of_the_gaps() -> None:
    made = velocities(*range(100))
    made.velocities = [
        replace(v, mono_ns=v.mono_ns + n % 2 * NS_PER_S // 1000)
        for n, v in enumerate(made.velocities)
    ]
    assert answers(made)[0].jitter == pytest.approx(0.002)  # gaps of 19 and 21 ms
    assert answers(velocities(*range(100)))[0].jitter == 0.0


def polled(*, late_every: int = 0, trip_s: float = 0.002) -> Streams:
    """Return answers as the bridge polls: the bumper each tick, counters and sonars seldom."""
    made, ms = Streams(), NS_PER_S // 1000
    for tick in range(500):
        begin_ns, head = tick * STEP_NS, {"seq": tick, "boot": 1}
        if tick % 10 == 0:
            made.add(replace(link(), round_trip=trip_s, mono_ns=begin_ns, **head))
        begin_ns -= tick % 3 * ms // 2  # ticks come a little early
        late_ms = 5 if late_every and tick % late_every == 0 else 0
        made.add(Bumper(pressed=False, mono_ns=begin_ns + (1 + late_ms) * ms, **head))
        if tick % 2 == 0:
            made.add(Mileage(distance=0, heading=0, epoch=0, mono_ns=begin_ns + 2 * ms, **head))
        if tick % 5 in (0, 2):
            status: tuple[RangeStatus, ...] = ("no_echo",) * 8
            ranges = Ultrasonic(ranges=(None,) * 8, status=status, **head)
            made.add(replace(ranges, mono_ns=begin_ns + 3 * ms))
    return made


def test_the_order_of_the_answers_after_their_queries() -> None:
    found = order(polled())
    assert found
    assert list(found.delays) == ["bumper", "mileage", "ultrasonic"]
    assert found.delays["mileage"] == pytest.approx(0.0015, abs=0.0006)
    assert (found.cycles, found.usual, found.late) == (350, 1.0, {})


def test_an_answer_that_is_late_is_named() -> None:
    found = order(polled(late_every=30))
    assert found
    assert found.late == {"bumper": 17}
    assert found.usual == pytest.approx(1 - 17 / 350)


def test_an_order_that_a_recording_does_not_show() -> None:
    assert order(polled(trip_s=0.015)) is None  # the answer may belong to the query before
    assert order(velocities(*range(9))) is None


def test_jitter_and_order_are_printed() -> None:
    made = polled(late_every=30)
    made.velocities = velocities(*range(100)).velocities
    lines = list(of_streams(made))
    assert any(line.startswith("velocity: ") and line.endswith("jitter 0.0 ms.") for line in lines)
    (shown,) = (line for line in lines if line.startswith("Order of the answers"))
    assert "queries: bumper 0.5 ms, mileage 1.5 ms, ultrasonic 2.5 ms; 95.1% of 350" in shown
    assert shown.endswith("cycles, late: bumper in 17.")
    (shown,) = (line for line in of_streams(polled(trip_s=0.015)) if "Order" in line)
    assert shown.endswith("not shown, without round trips of at most 10 ms.")
