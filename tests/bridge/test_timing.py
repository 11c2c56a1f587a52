"""How durations are counted, what is left out, and what is read out of a histogram."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from common.messages import Durations, Motion
from common.motion import Command
from services.bridge.rx_timestamp import Receipt
from services.bridge.timing import BOUNDS_NS, LONGEST_NS, Histogram, Timings, quantile

MS = 1_000_000
BOUNDS_S = [bound / NS_PER_S for bound in BOUNDS_NS]
HIT = Receipt(kernel_ns=100 * MS, read_ns=101 * MS)
# Requested at 10 ms, received at 12, sent at 15.
ANSWER = Motion(command=Command.RUN, asked_ns=10 * MS, heard_ns=12 * MS, mono_ns=15 * MS)
# The hit in sample 7: received at 105 ms, judged and sent at 109.
VERDICT = Motion(command=Command.BRAKE, judged=7, judged_ns=105 * MS, mono_ns=109 * MS)


def measured(timings: Timings) -> dict[str, float]:
    """Return the durations that were counted once, in milliseconds."""
    durations = timings.message().durations
    assert all(sum(each.counts) <= 1 for each in durations.values())
    return {name: each.worst * 1000 for name, each in durations.items() if sum(each.counts)}


def left_out(timings: Timings) -> dict[str, int]:
    return timings.message().not_counted


# --- histograms -------------------------------------------------------------------------------


def test_bounds_go_from_10_us_to_1_s_a_third_more_each() -> None:
    assert (BOUNDS_NS[0], BOUNDS_NS[8], BOUNDS_NS[-1]) == (10_000, 100_000, NS_PER_S)
    assert all(b / a == pytest.approx(10 ** (1 / 8), rel=1e-3) for a, b in pairwise(BOUNDS_NS))


@pytest.mark.parametrize(
    ("duration_ns", "bucket"),
    [(0, 0), (10_000, 0), (10_001, 1), (NS_PER_S, 40), (NS_PER_S + 1, 41), (9 * NS_PER_S, 41)],
)
def test_a_duration_goes_into_the_first_bucket_whose_bound_it_keeps(
    duration_ns: int, bucket: int
) -> None:
    histogram = Histogram()
    histogram.add(duration_ns)
    message = histogram.message()
    assert [n for n, count in enumerate(message.counts) if count] == [bucket]
    assert message.counts[bucket] == 1
    assert message.worst == duration_ns / NS_PER_S


def test_the_worst_stays() -> None:
    histogram = Histogram()
    for duration_ns in (5 * MS, 9 * MS, 7 * MS):
        histogram.add(duration_ns)
    assert histogram.message().worst == 0.009
    assert sum(histogram.message().counts) == 3


def test_the_message_has_a_histogram_for_each_way_and_hop() -> None:
    message = Timings().message()
    assert list(message.bounds) == BOUNDS_S
    assert list(message.durations) == [
        "board_to_bridge",
        "contact_to_break",
        "contact_to_break.board_to_bridge",
        "contact_to_break.bridge_to_break",
        "judged_stop",
        "judged_stop.board_to_bridge",
        "judged_stop.bridge_to_safety",
        "judged_stop.in_safety",
        "judged_stop.safety_to_bridge",
        "judged_stop.bridge_to_break",
        "request_to_frame",
        "request_to_frame.driver_to_safety",
        "request_to_frame.in_safety",
        "request_to_frame.safety_to_bridge",
        "request_to_frame.bridge_to_frame",
    ]
    assert {len(each.counts) for each in message.durations.values()} == {len(BOUNDS_NS) + 1}
    assert message.not_counted == {}


# --- ways -------------------------------------------------------------------------------------


def test_a_datagram_that_was_read() -> None:
    timings = Timings()
    timings.on_read(HIT)
    assert measured(timings) == {"board_to_bridge": 1}
    assert left_out(timings) == {}


def test_a_datagram_without_a_stamp_is_left_out_and_counted() -> None:
    timings = Timings()
    timings.on_read(Receipt(None, 5))
    timings.on_read(Receipt(None, 6))
    assert measured(timings) == {}
    assert left_out(timings) == {"no_kernel_stamp": 2}


def test_the_reflex() -> None:
    timings = Timings()
    timings.on_reflex(7, HIT, 103 * MS)
    assert measured(timings) == {
        "contact_to_break": 3,
        "contact_to_break.board_to_bridge": 1,
        "contact_to_break.bridge_to_break": 2,
    }


def test_a_contact_without_a_stamp_begins_when_it_was_read() -> None:
    timings = Timings()
    timings.on_reflex(7, Receipt(None, 101 * MS), 103 * MS)
    assert measured(timings) == {"contact_to_break": 2, "contact_to_break.bridge_to_break": 2}


def test_a_request_that_became_a_frame() -> None:
    timings = Timings()
    timings.on_motion(ANSWER, True, 20 * MS, 26 * MS)
    assert measured(timings) == {
        "request_to_frame": 16,
        "request_to_frame.driver_to_safety": 2,
        "request_to_frame.in_safety": 3,
        "request_to_frame.safety_to_bridge": 5,
        "request_to_frame.bridge_to_frame": 6,
    }
    assert left_out(timings) == {}


def test_of_a_foreign_driver_only_our_own_hops_are_measured() -> None:
    timings = Timings()
    answer = Motion(command=Command.RUN, heard_ns=12 * MS, mono_ns=15 * MS)
    timings.on_motion(answer, True, 20 * MS, 26 * MS)
    assert measured(timings) == {
        "request_to_frame.in_safety": 3,
        "request_to_frame.safety_to_bridge": 5,
        "request_to_frame.bridge_to_frame": 6,
    }
    assert left_out(timings) == {"foreign_clock": 1}


def test_of_a_foreign_safety_only_the_last_hop_is_measured() -> None:
    timings = Timings()
    timings.on_motion(ANSWER, False, 20 * MS, 26 * MS)
    assert measured(timings) == {"request_to_frame.bridge_to_frame": 6}
    assert left_out(timings) == {"foreign_clock": 1}


def test_a_motion_that_answers_no_request_is_not_measured() -> None:
    timings = Timings()
    for shared in (True, False):
        timings.on_motion(Motion(command=Command.RUN, mono_ns=15 * MS), shared, 20 * MS, 26 * MS)
    assert measured(timings) == {}
    assert left_out(timings) == {}


def test_the_judged_stop() -> None:
    timings = Timings()
    timings.on_reflex(7, HIT, 102 * MS)
    timings.on_acked(VERDICT, True, 114 * MS, 120 * MS)
    judged = {name: ms for name, ms in measured(timings).items() if name.startswith("judged")}
    assert judged == {
        "judged_stop": 20,
        "judged_stop.board_to_bridge": 1,
        "judged_stop.bridge_to_safety": 4,
        "judged_stop.in_safety": 4,
        "judged_stop.safety_to_bridge": 5,
        "judged_stop.bridge_to_break": 6,
    }
    assert left_out(timings) == {}


@pytest.mark.parametrize(
    ("seq", "shared", "reasons"),
    [(6, True, {}), (7, False, {"foreign_clock": 1}), (6, False, {"foreign_clock": 1})],
)
def test_by_a_later_sample_or_a_foreign_safety_the_whole_is_still_known(
    seq: int, shared: bool, reasons: dict[str, int]
) -> None:
    timings = Timings()
    timings.on_reflex(seq, Receipt(None, 101 * MS), 102 * MS)
    timings.on_acked(VERDICT, shared, 114 * MS, 120 * MS)
    judged = {name: ms for name, ms in measured(timings).items() if name.startswith("judged")}
    assert judged == {"judged_stop": 19, "judged_stop.bridge_to_break": 6}
    assert left_out(timings) == reasons


def test_a_hit_is_judged_once() -> None:
    timings = Timings()
    timings.on_acked(VERDICT, True, 114 * MS, 120 * MS)
    assert measured(timings) == {}
    timings.on_reflex(7, HIT, 102 * MS)
    for _ in range(2):
        timings.on_acked(VERDICT, True, 114 * MS, 120 * MS)
    assert measured(timings)["judged_stop"] == 20


@pytest.mark.parametrize(
    ("sent_ns", "counted"),
    [(HIT.read_ns - 1, 0), (HIT.read_ns, 1), (HIT.read_ns + LONGEST_NS, 1),
     (HIT.read_ns + LONGEST_NS + 1, 0)],
)  # fmt: skip
def test_what_cannot_be_true_is_left_out_and_counted(sent_ns: int, counted: int) -> None:
    timings = Timings()
    timings.on_reflex(7, Receipt(None, HIT.read_ns), sent_ns)
    assert sum(timings.message().durations["contact_to_break"].counts) == counted
    # The whole and its one known hop.
    assert left_out(timings) == ({} if counted else {"implausible": 2})


# --- quantiles --------------------------------------------------------------------------------


def histogram(*durations_ns: int) -> Durations:
    made = Histogram()
    for duration_ns in durations_ns:
        made.add(duration_ns)
    return made.message()


def test_of_nothing_there_is_no_quantile() -> None:
    assert quantile(BOUNDS_S, histogram(), 0.5) is None


def test_a_quantile_is_its_buckets_bound_but_never_more_than_the_worst() -> None:
    of_100 = histogram(*[9_000] * 50, *[90_000] * 49, 12 * MS)
    assert quantile(BOUNDS_S, of_100, 0.5) == 10e-6
    assert quantile(BOUNDS_S, of_100, 0.51) == quantile(BOUNDS_S, of_100, 0.99) == 100e-6
    assert quantile(BOUNDS_S, of_100, 1.0) == 0.012
    assert quantile(BOUNDS_S, histogram(5 * NS_PER_S), 0.5) == 5.0


@given(st.lists(st.integers(0, 2 * NS_PER_S), min_size=1), st.sampled_from([0.5, 0.99]))
def test_a_quantile_is_never_too_small_and_at_most_one_bucket_too_large(
    durations_ns: list[int], part: float
) -> None:
    reported = quantile(BOUNDS_S, histogram(*durations_ns), part)
    ranked = sorted(durations_ns)
    true_s = next(d for n, d in enumerate(ranked, 1) if n >= part * len(ranked)) / NS_PER_S
    assert reported is not None
    assert (
        true_s
        <= reported
        <= max(10e-6, min(true_s * 1.34, ranked[-1] / NS_PER_S) if true_s <= 1 else reported)
    )
