"""Timeline of a recorded drive: series, streams, and stops with their reasons."""

import math

import pytest

from cli.recordings.timeline import Phase, Series, Stop, Stream, add_state, downsampled, stops
from t2.messages import Cause, Drive, SafetyState, Velocity, Verdict
from tests import factories
from tests.cli.recordings.drive_fixture import CONTACT, HIT_S, RESET_S, at, drive, timeline_of


def test_the_timeline_of_a_drive() -> None:
    timeline = timeline_of(*drive())
    assert set(timeline.linear.requested) == {"teleop"}
    assert set(timeline.linear.requested["teleop"].values) == {0.5}
    allowed = zip(timeline.linear.allowed.times, timeline.linear.allowed.values, strict=True)
    assert all((value == 0.0) == (HIT_S <= at_s < RESET_S) for at_s, value in allowed)
    assert set(timeline.angular.measured.values) == {0.1}
    (stop,) = timeline.stops
    assert (stop.begins_s, stop.ends_s) == (HIT_S, RESET_S)
    assert (list(stop.reasons), stop.was_driving) == (["contact"], True)
    assert [(each.at_s, each.service) for each in timeline.events] == [(HIT_S, "safety")]
    assert timeline.distance == pytest.approx(199 * 0.02)
    assert timeline.versions == {"bridge": "0.1.0"}
    assert timeline.lasted_s == pytest.approx(9.95)


def test_a_new_odometry_epoch_starts_a_new_segment() -> None:
    poses = [factories.odometry(x=0.02 * (n % 2), epoch=n // 2) for n in range(4)]
    timeline = timeline_of(*(at("tel/odom/odometry", pose, 0.0) for pose in poses))
    assert [len(segment.xs) for segment in timeline.path] == [2, 2]
    assert timeline.distance == pytest.approx(0.04)


def test_a_gap_is_marked_with_nan() -> None:
    series = Series()
    for at_s in (0.0, 0.1, 2.0):
        series.add(at_s, 1.0)
    assert series.times == [0.0, 0.1, 0.1, 2.0]
    assert math.isnan(series.values[2])


def test_downsampling_keeps_peaks_and_gaps() -> None:
    times = [float(number) for number in range(10_000)]
    values = [0.0] * 10_000
    values[1234], values[5678], values[9000] = 7.0, -7.0, math.nan
    fewer_times, fewer = downsampled(times, values, limit=400)
    assert len(fewer) <= 400
    assert dict(zip(fewer_times, fewer, strict=True))[1234.0] == 7.0
    assert (max(fewer), min(fewer)) == (7.0, -7.0)
    assert any(math.isnan(value) for value in fewer)
    assert fewer_times == sorted(fewer_times)
    assert all(map(math.isnan, downsampled(times, [math.nan] * 10_000, limit=400)[1]))
    assert downsampled(times[:5], values[:5]) == (times[:5], values[:5])


# --- streams ------------------------------------------------------------------------------------


def test_rate_gaps_and_losses() -> None:
    stream = Stream("t2/v1/001/tel/bridge/velocity")
    for at_s, seq, boot in ((0.0, 1, 9), (0.08, 2, 9), (0.5, 5, 9), (0.52, 1, 10)):
        stream.add(at_s, Velocity(seq=seq, boot=boot, linear=0.0, angular=0.0))
    stream.add(0.54, None)
    assert (stream.expected_hz, stream.lost, stream.undecoded) == (50, 2, 1)
    assert stream.hz == pytest.approx(4 / 0.54)
    assert stream.gaps == [pytest.approx(0.08), pytest.approx(0.42)]


def test_events_and_sources_have_no_gaps_and_an_emergency_stop_no_message_to_decode() -> None:
    stream = Stream("t2/v1/001/@cmd/drive/teleop")
    for at_s in (0.0, 9.0):
        stream.add(at_s, Drive(seq=int(at_s) + 1, boot=9, linear=0.0, angular=0.0, echo=1))
    assert (stream.gaps, stream.expected_hz) == ([], 0.0)
    assert Stream("t2/v1/001/@cmd/fix/tags").expected_hz == 0.0  # not always in sight
    stop = Stream("t2/v1/001/estop")
    stop.add(0.0, None)
    assert (stop.undecoded, stop.hz) == (0, None)


# --- stops --------------------------------------------------------------------------------------

IDLE = Cause(name="no_request", action="stop", age=0.0, text="No command to drive.")
LINK = Cause(name="link", action="stop", age=0.0, text="The link to the board is lost.")
SLOWED = Cause(name="obstacle", action="slow", age=0.0, text="Slowed by an obstacle.")


def made_of(verdict: Verdict, causes: tuple[Cause, ...]) -> SafetyState:
    return factories.safety_state(verdict=verdict, causes=causes)


Step = tuple[float, float, Verdict, tuple[Cause, ...]]  # begin, end, verdict, causes


@pytest.mark.parametrize(
    ("steps", "found"),
    [
        (  # a contact while driving, and a reset
            [(0, 2, "run", ()), (2, 5, "brake", (CONTACT, IDLE)), (5, 9, "stop", (IDLE,))],
            [Stop(2, 5, True, "brake", {"contact": CONTACT})],
        ),
        (  # consecutive reasons are one stop
            [(0, 1, "inhibited", (LINK,)), (1, 2, "brake", (CONTACT, LINK)), (2, 3, "run", ())],
            [Stop(0, 2, False, "inhibited", {"link": LINK, "contact": CONTACT})],
        ),
        ([(0, 5, "stop", (IDLE,)), (5, 9, "slow", (SLOWED,))], []),
        (  # a gap in the state of safety ends a stop
            [(0, 1, "inhibited", (LINK,)), (4, 5, "inhibited", (LINK,))],
            [Stop(0, 1, False, "inhibited", {"link": LINK}),
             Stop(4, 5, False, "inhibited", {"link": LINK})],
        ),
    ],
)  # fmt: skip
def test_stops_with_their_reasons(steps: list[Step], found: list[Stop]) -> None:
    phases = [
        Phase(begins_s, ends_s, made_of(verdict, causes))
        for begins_s, ends_s, verdict, causes in steps
    ]
    assert stops(phases) == found


@pytest.mark.parametrize(
    ("later", "is_same"),
    [
        (made_of("brake", (CONTACT,)), True),
        (made_of("stop", (CONTACT,)), False),
        (made_of("brake", (CONTACT, LINK)), False),
    ],
)
def test_a_phase_lasts_until_another_state(later: SafetyState, is_same: bool) -> None:
    phases: list[Phase] = []
    add_state(phases, 0.0, made_of("brake", (CONTACT,)), 0.5)
    add_state(phases, 0.5, later, 0.5)
    add_state(phases, 1.1, later, 0.5)  # after a gap
    assert [(phase.begins_s, phase.ends_s) for phase in phases] == (
        [(0.0, 0.5), (1.1, 1.1)] if is_same else [(0.0, 0.5), (0.5, 0.5), (1.1, 1.1)]
    )
