"""What a recording tells, in series."""

import math

import msgspec
import pytest

from cli.recordings.report.downsampling import thinned
from cli.recordings.report.reactions import reactions
from cli.recordings.report.story import Series, Story
from cli.recordings.report.streams import Stream
from common.freshness import NS_PER_S
from common.messages import Durations, Health, Timing, Velocity
from tests.cli.recordings.report import drive_fixture
from tests.cli.recordings.report.drive_fixture import BEGIN_NS, HIT_S, RESET_S, drive


@pytest.fixture
def story() -> Story:
    """The drive of the scene."""
    made = Story()
    for told in drive():
        made.hear(*told)
    return made


def test_who_asked_what_was_allowed_and_what_came_of_it(story: Story) -> None:
    assert set(story.linear.asked) == {"teleop"}
    assert set(story.linear.asked["teleop"].values) == {0.5}
    allowed = zip(story.linear.allowed.times, story.linear.allowed.values, strict=True)
    assert all((value == 0.0) == (HIT_S <= at_s < RESET_S) for at_s, value in allowed)
    assert set(story.angular.measured.values) == {0.1}
    assert (set(story.linear.upper.values), set(story.linear.lower.values)) == ({0.8}, {-0.5})


def test_the_stop_its_reason_and_the_event(story: Story) -> None:
    (stop,) = story.stops
    assert (stop.begins_s, stop.ends_s) == (HIT_S, RESET_S)
    assert (list(stop.reasons), stop.over, stop.was_driving) == (["contact"], True, True)
    assert [(told.at_s, told.service) for told in story.events] == [(HIT_S, "safety")]


def test_path_ranges_bumper_and_versions(story: Story) -> None:
    assert story.distance == pytest.approx(199 * 0.02)
    assert math.isnan(story.ranges["front_left"].values[0])
    assert story.ranges["left"].values[0] == 1.0
    assert [phase.lasts_s for phase in story.pressed.done if phase.state] == [pytest.approx(1.0)]
    assert story.versions == {"bridge": "0.1.0"}
    assert story.lasted_s == pytest.approx(9.95)


def test_a_new_epoch_of_odometry_begins_a_new_stretch() -> None:
    story = Story()
    for number in range(4):
        message = drive_fixture.odometry(number % 2, epoch=number // 2)
        story.hear(*drive_fixture.at("tel/odom/odometry", message, number / 50))
    assert [len(stretch.xs) for stretch in story.path] == [2, 2]
    assert story.distance == pytest.approx(0.04)


def test_no_line_goes_through_a_pause() -> None:
    series = Series()
    for at_s in (0.0, 0.1, 2.0):
        series.add(at_s, 1.0)
    assert series.times == [0.0, 0.1, 0.1, 2.0]
    assert math.isnan(series.values[2])


def test_a_stream_s_rate_gaps_losses_and_restarts() -> None:
    stream = Stream("t2/v1/001/tel/bridge/velocity")
    for at_s, seq, boot in ((0.0, 1, 9), (0.02, 2, 9), (0.5, 5, 9), (0.52, 1, 10)):
        stream.take(at_s, Velocity(seq=seq, boot=boot, linear=0.0, angular=0.0))
    stream.take(0.54, None)
    assert (stream.expected_hz, stream.lost, stream.restarts, stream.unread) == (50, 2, 1, 1)
    assert stream.hz == pytest.approx(4 / 0.54)
    assert stream.gaps == [(0.02, 0.5)]
    assert stream.pause_s(1.0) == pytest.approx(0.48)


def test_a_key_that_the_table_does_not_have_is_only_counted() -> None:
    stream = Stream("t2/v1/001/tel/lidar/points")
    stream.take(0.0, None)
    assert (stream.hz, stream.gaps, stream.pause_s(0.5)) == (None, [], None)
    stream.take(9.0, None)
    assert stream.gaps == []
    assert stream.hz == pytest.approx(1 / 9)


def test_thinning_keeps_peaks_and_holes() -> None:
    times = [float(number) for number in range(10_000)]
    values = [0.0] * 10_000
    values[1234], values[5678], values[9000] = 7.0, -7.0, math.nan
    fewer_times, fewer = thinned(times, values, most=400)
    assert len(fewer) <= 400
    assert dict(zip(fewer_times, fewer, strict=True))[1234.0] == 7.0
    assert (max(fewer), min(fewer)) == (7.0, -7.0)
    assert any(math.isnan(value) for value in fewer)
    assert fewer_times == sorted(fewer_times)
    assert all(map(math.isnan, thinned(times, [math.nan] * 10_000, most=400)[1]))
    assert thinned(times[:5], values[:5]) == (times[:5], values[:5])


def timed(counts: tuple[int, ...], worst: float) -> Health:
    """Return a health message of a bridge with this histogram of one reaction."""
    durations = {"contact_to_break": Durations(counts=counts, worst=worst)}
    return Health(
        service="bridge", version="", uptime=0.0, rates={}, counters={}, lateness=0.0, rss=0,
        timing=Timing(bounds=(0.001, 0.002), durations=durations, not_counted={}),
    )  # fmt: skip


def test_reactions_of_before_the_recording_do_not_count() -> None:
    (one,) = reactions([(timed((5, 0, 3), 0.5), timed((15, 1, 3), 0.5))])
    assert (one.count, one.p50, one.p99) == (11, 0.001, 0.002)
    assert one.worst == 0.002, "the worst was before; the slowest bucket's bound stands for it"


def test_a_worst_that_rose_is_of_the_recording_and_lives_add_up() -> None:
    (one,) = reactions(
        [(timed((1, 0, 0), 0.001), timed((1, 0, 1), 0.7)), (timed((0, 0, 0), 0.0),) * 2]
    )
    assert (one.count, one.worst) == (1, 0.7)


def test_a_reaction_that_was_first_told_in_the_recording_counts_whole() -> None:
    before = timed((), 0.0)
    assert before.timing is not None
    nothing = msgspec.structs.replace(
        before, timing=msgspec.structs.replace(before.timing, durations={})
    )
    (one,) = reactions([(nothing, timed((2, 1, 0), 0.0015))])
    assert (one.count, one.worst) == (3, 0.0015)


def test_without_a_reaction_there_are_no_figures() -> None:
    (one,) = reactions([(timed((1, 0, 0), 0.1), timed((1, 0, 0), 0.1))])
    assert (one.count, one.p50, one.p99, one.worst) == (0, None, None, None)
    silent = Health(
        service="bridge", version="", uptime=0.0, rates={}, counters={}, lateness=0.0, rss=0
    )
    assert reactions([(silent, silent)]) == []


def test_time_runs_from_the_first_message() -> None:
    story = Story()
    story.hear("t2/v1/001/tel/mine", None, BEGIN_NS)
    story.hear("t2/v1/001/tel/mine", None, BEGIN_NS + 3 * NS_PER_S)
    assert (story.lasted_s, story.streams["t2/v1/001/tel/mine"].times) == (3.0, [0.0, 3.0])
