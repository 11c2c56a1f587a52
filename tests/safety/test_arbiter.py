"""Arbiter: reasons of refusal, the source in control, and arming."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.heartbeat import Heartbeat
from common.messages import Drive
from common.motion import Twist
from services.safety.config import Safety
from services.safety.core.inputs import DriveRequest
from services.safety.core.sources import CONFLICT_NS, Admission, Arbiter, DriveChannel

SOURCES = Safety().sources
AGE_NS = 400_000_000
BEAT = Heartbeat(40).beat(0)  # sent 41 at time 0


def request(
    arbiter: Arbiter,
    now_ns: int,
    *,
    source: str = "teleop",
    seq: int = 1,
    boot: int = 1,
    linear: float = 0.0,
    echo: int = 41,
) -> tuple[Arbiter, str]:
    drive = Drive(linear=linear, angular=0.0, echo=echo, seq=seq, boot=boot)
    return arbiter.accept(DriveRequest(source, drive, now_ns), Admission(BEAT, AGE_NS, now_ns))


def accepted(arbiter: Arbiter, now_ns: int, source: str = "teleop", linear: float = 0.0) -> Arbiter:
    arbiter, refused = request(arbiter, now_ns, source=source, linear=linear)
    assert refused == ""
    return arbiter


@pytest.mark.parametrize("linear", [math.nan, math.inf, -math.inf])
def test_a_non_finite_request_is_refused(linear: float) -> None:
    assert request(Arbiter(SOURCES), 0, linear=linear)[1] == "not_finite"
    wrong = Drive(linear=0.0, angular=linear, echo=41)
    assert (
        Arbiter(SOURCES).accept(DriveRequest("web", wrong), Admission(BEAT, AGE_NS, 0))[1]
        == "not_finite"
    )


@pytest.mark.parametrize(
    ("echo", "now_ns", "reason"),
    [
        (41, 0, ""),
        (41, AGE_NS, ""),
        (41, AGE_NS + 1, "late"),
        (40, 0, "late"),
        (42, 0, "late"),
    ],
)
def test_a_late_or_unknown_echo_is_refused(echo: int, now_ns: int, reason: str) -> None:
    assert request(Arbiter(SOURCES), now_ns, echo=echo)[1] == reason


@pytest.mark.parametrize(("seq", "reason"), [(4, "seq_not_rising"), (5, "seq_not_rising"), (6, "")])
def test_seq_rises_within_its_boot(seq: int, reason: str) -> None:
    arbiter, _ = request(Arbiter(SOURCES), 0, seq=5)
    assert request(arbiter, 1, seq=seq)[1] == reason


def test_unknown_sources_and_nonsense_are_refused() -> None:
    assert request(Arbiter(SOURCES), 0, source="nobody") == (Arbiter(SOURCES), "unknown_source")
    assert (
        Arbiter(SOURCES).accept(DriveRequest("web", None), Admission(BEAT, AGE_NS, 0))[1]
        == "not_a_request"
    )


def test_a_second_boot_waits_for_the_first_lease_to_end() -> None:
    lease_ns = round(SOURCES["teleop"].lease * NS_PER_S)
    arbiter = accepted(Arbiter(SOURCES), 0).armed(0)
    refused, reason = request(arbiter, lease_ns, boot=2)
    assert reason == "second_publisher"
    assert refused.conflict(lease_ns) == ["teleop"]
    assert refused.conflict(lease_ns + 1) == []  # not in control any more
    taken, reason = request(arbiter, lease_ns + 1, boot=2)
    assert reason == ""
    assert not taken.channels["teleop"].neutral  # a new start has to be neutral first
    taken, reason = request(refused, lease_ns + 1, boot=2)
    assert reason == ""
    assert taken.conflict(lease_ns + 1) == ["teleop"]  # the first may still be there
    taken, _ = request(taken, lease_ns + CONFLICT_NS, boot=2, seq=2)
    assert taken.conflict(lease_ns + CONFLICT_NS) == []


@pytest.mark.parametrize("seq", [4, 5])
def test_a_lower_seq_of_a_known_boot_is_a_new_publisher_after_the_age(seq: int) -> None:
    arbiter = request(Arbiter(SOURCES), 0, seq=5)[0].armed(0)
    arbiter, _ = request(arbiter, 1, boot=2)  # a conflict, which a copy does not end
    beat = BEAT.beat(AGE_NS)
    copy = DriveRequest("teleop", Drive(linear=0.1, angular=0.0, echo=42, seq=seq, boot=1), AGE_NS)
    assert arbiter.accept(copy, Admission(beat, AGE_NS, AGE_NS)) == (arbiter, "seq_not_rising")
    later_ns = AGE_NS + 1
    copy, admission = replace(copy, received_ns=later_ns), Admission(beat, AGE_NS, later_ns)
    taken, reason = arbiter.accept(copy, admission)
    assert reason == ""
    assert not taken.channels["teleop"].neutral
    assert (taken.channels["teleop"].seq, taken.conflict(later_ns)) == (seq, ["teleop"])
    assert copy.drive
    replayed = replace(copy, drive=replace(copy.drive, echo=41))  # as before the last request
    assert arbiter.accept(replayed, admission) == (arbiter, "late")


@pytest.mark.parametrize("seq", [0, 1, 9])
def test_a_new_boot_counts_anew(seq: int) -> None:
    arbiter, _ = request(Arbiter(SOURCES), 0, seq=5)
    later = round(SOURCES["teleop"].lease * NS_PER_S) + 1
    arbiter, reason = request(arbiter, later, boot=2, seq=seq)
    assert reason == ""
    assert request(arbiter, later, boot=2, seq=seq)[1] == "seq_not_rising"


def test_the_wish_is_what_was_asked_for() -> None:
    arbiter, _ = request(Arbiter(SOURCES), 0)
    assert not arbiter.requests_motion(0)
    for linear, angular in ((0.1, -0.2), (0.0, 0.3), (0.4, 0.0)):
        drive = Drive(
            linear=linear, angular=angular, echo=41, boot=1, seq=arbiter.channels["teleop"].seq + 1
        )
        arbiter, refused = arbiter.accept(DriveRequest("teleop", drive), Admission(BEAT, AGE_NS, 0))
        assert (arbiter.channels["teleop"].requested, refused) == (Twist(linear, angular), "")
        assert arbiter.requests_motion(0)


def test_two_publishers_bar_only_their_own_source() -> None:
    arbiter = accepted(Arbiter(SOURCES), 0, "web")
    arbiter, _ = request(arbiter, 0, source="web", boot=2)
    assert arbiter.conflict(0) == ["web"]
    assert accepted(arbiter, 0, "teleop").conflict(0) == []
    assert accepted(arbiter, 0, "nav").conflict(0) == ["web"]


@pytest.mark.parametrize(("gap_s", "neutral"), [(1.0, True), (1.1, False)])
def test_a_source_that_was_suspended_is_due_a_neutral_request(gap_s: float, neutral: bool) -> None:
    """An SDK program after SIGSTOP and SIGCONT."""
    arbiter = accepted(Arbiter(SOURCES), 0).armed(0)
    at_ns = round((SOURCES["teleop"].lease + gap_s) * NS_PER_S)
    drive = Drive(linear=0.5, angular=0.0, echo=42, seq=2, boot=1)
    now = Admission(BEAT.beat(at_ns), AGE_NS, at_ns)
    arbiter, refused = arbiter.accept(DriveRequest("teleop", drive, at_ns), now)
    assert refused == ""
    assert arbiter.channels["teleop"].neutral is neutral


def test_a_source_starts_without_requests() -> None:
    assert DriveChannel() == DriveChannel(
        boot=None, seq=0, received_ns=None, conflict_ns=None, requested=Twist(0.0, 0.0),
        neutral=False, overruled_by="",
    )  # fmt: skip
    assert CONFLICT_NS == 500_000_000


def test_an_absent_driver_is_none() -> None:
    assert Arbiter(SOURCES).in_control(0) is None
    assert Arbiter(SOURCES).conflict(0) == []


def test_only_a_fresh_zero_arms_and_disarming_is_for_all() -> None:
    arbiter = accepted(accepted(Arbiter(SOURCES), 0), 0, "web", 0.5)
    arbiter = arbiter.armed(0)
    assert arbiter.channels["teleop"].neutral
    assert not arbiter.channels["web"].neutral
    arbiter = arbiter.disarmed()
    assert arbiter.channels["teleop"].neutral is False
    assert not arbiter.armed(NS_PER_S).channels["teleop"].neutral
    assert arbiter.requests_motion(0)
    assert not arbiter.requests_motion(NS_PER_S)


def test_a_lease_counts_from_the_reception() -> None:
    drive = Drive(linear=0.0, angular=0.0, echo=41, seq=1, boot=1)
    lease_ns, late_ns = round(SOURCES["teleop"].lease * NS_PER_S), 100_000_000
    arbiter, _ = Arbiter(SOURCES).accept(
        DriveRequest("teleop", drive, 5), Admission(BEAT, AGE_NS, late_ns)
    )
    assert arbiter.in_control(5 + lease_ns) == "teleop"
    assert arbiter.in_control(5 + lease_ns + 1) is None
    assert not arbiter.armed(5 + lease_ns + 1).channels["teleop"].neutral
    # As does the time of a second publisher.
    other = Drive(linear=0.0, angular=0.0, echo=41, seq=1, boot=2)
    arbiter, refused = arbiter.accept(
        DriveRequest("teleop", other, 6), Admission(BEAT, AGE_NS, late_ns)
    )
    assert (refused, arbiter.conflict(6)) == ("second_publisher", ["teleop"])
    _, refused = arbiter.accept(
        DriveRequest("teleop", other, 6 + lease_ns), Admission(BEAT, AGE_NS, 7)
    )
    assert refused == ""


def test_the_source_in_control_overrules_lower_ones_only() -> None:
    arbiter = Arbiter(SOURCES)
    lowest = accepted(arbiter, 0, "nav")
    for nobody_below in (arbiter, lowest):
        assert nobody_below.overruled(0) is nobody_below
    for source in ("teleop", "web", "nav"):
        arbiter = accepted(arbiter, 0, source)
    arbiter = accepted(arbiter, 0, "demo", 0.3).armed(0)
    neutral = replace(
        arbiter, channels={n: c for n, c in arbiter.channels.items() if n != "teleop"}
    )
    neutral = neutral.overruled(0)
    assert {name: one.neutral for name, one in neutral.channels.items()} == {
        "web": True, "demo": False, "nav": False
    }  # fmt: skip
    assert {one.overruled_by for one in arbiter.channels.values()} == {""}
    assert neutral.channels["nav"].overruled_by == "web"
    assert arbiter.overruled(NS_PER_S).channels == arbiter.channels  # nobody holds it
    again = neutral.armed(0)
    assert again.channels["nav"].neutral
    assert again.channels["nav"].overruled_by == ""
    assert again.channels["demo"].overruled_by == "web"  # it asks for motion


@given(
    st.lists(
        st.tuples(st.sampled_from([*SOURCES, "nobody"]), st.integers(0, 400), st.floats(-1, 1)),
        max_size=30,
    )
)
def test_the_best_fresh_source_drives_whatever_comes(
    asked: list[tuple[str, int, float]],
) -> None:
    arbiter, last, now_ns = Arbiter(SOURCES), {}, 0
    beat = Heartbeat()
    for seq, (source, pause_ms, linear) in enumerate(asked, start=1):
        now_ns += pause_ms * 1_000_000
        beat = beat.beat(now_ns)
        drive = Drive(linear=linear, angular=0.0, echo=beat.number, seq=seq, boot=3)
        arbiter, refused = arbiter.accept(
            DriveRequest(source, drive, now_ns), Admission(beat, AGE_NS, now_ns)
        )
        assert refused == ("" if source in SOURCES else "unknown_source")
        if not refused:
            last[source] = (now_ns, linear)
        fresh = [n for n, (at, _) in last.items() if now_ns - at <= SOURCES[n].lease * NS_PER_S]
        best = max(fresh, key=lambda n: SOURCES[n].priority, default=None)
        assert arbiter.in_control(now_ns) == best
        if best:
            assert arbiter.channels[best].requested == Twist(last[best][1], 0.0)
