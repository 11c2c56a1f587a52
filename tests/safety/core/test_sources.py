"""Sources: admission of messages, the source in control, speed limits and keepalives."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.heartbeat import Heartbeat
from common.motion import ROUNDED_MPS, ROUNDED_RADPS, STILL, Twist
from services.safety.config import LimitSource, Safety
from services.safety.core.arbiter import Arbiter, DriveChannel
from services.safety.core.channel import CONFLICT_NS, Admission
from services.safety.core.inputs import DriveRequest, LimitRequest
from services.safety.core.speed_limits import LimitChannel, SpeedLimits
from t2.messages import Drive, Limit, LimitState
from t2.words import render

MS = NS_PER_S // 1000
AGE_NS = 400 * MS
LEASE_S, LEASE_NS = 0.5, 500 * MS
TIMEOUT_S, TIMEOUT_NS = 1.0, NS_PER_S
BEAT = Heartbeat(40).beat(0).beat(300 * MS)  # sent 41 at 0, 42 at 0.3 s
SOURCES = Safety().sources
TELEOP_NS = round(SOURCES["teleop"].lease * NS_PER_S)
LIMITERS = {
    "lidar": LimitSource(lease=LEASE_S, silence="stop"),
    "fleet": LimitSource(lease=LEASE_S, silence="ignore"),
}
DRIVES, LIMITS = Arbiter(SOURCES), SpeedLimits(LIMITERS)
LATCHING = LimitSource(lease=TIMEOUT_S, silence="latch")
KEPT = SpeedLimits({"pendant": LATCHING, "web": LATCHING})


def admission(now_ns: int) -> Admission:
    """Return an admission for which the newest heartbeat is always young enough."""
    return Admission(BEAT, AGE_NS, min(now_ns, AGE_NS))


def request(
    arbiter: Arbiter,
    now_ns: int = 0,
    source: str = "teleop",
    linear: float = 0.0,
    *,
    seq: int = 1,
    boot: int = 1,
    **fields: Any,
) -> tuple[Arbiter, str]:
    fields = {"angular": 0.0, "echo": 41, **fields}
    drive = Drive(linear=linear, seq=seq, boot=boot, **fields)
    return arbiter.accept(DriveRequest(source, drive, now_ns), admission(now_ns))


def limit(
    limits: SpeedLimits,
    linear: float | None = None,
    now_ns: int = 0,
    *,
    source: str = "lidar",
    seq: int = 1,
    boot: int = 1,
    **fields: Any,
) -> tuple[SpeedLimits, str]:
    message = Limit(linear=linear, seq=seq, boot=boot, **{"echo": 41, **fields})
    return limits.accept(LimitRequest(source, message, now_ns), admission(now_ns))


def keep(
    keepalives: SpeedLimits,
    now_ns: int = 0,
    *,
    source: str = "pendant",
    echo: int = 41,
    seq: int = 1,
    boot: int = 1,
    late_ns: int = 0,
    **caps: Any,
) -> tuple[SpeedLimits, str]:
    message = Limit(echo=echo, seq=seq, boot=boot, **caps)
    checked = Admission(BEAT, TIMEOUT_NS, now_ns + late_ns)
    return keepalives.accept(LimitRequest(source, message, now_ns), checked)


# --- admission ------------------------------------------------------------------------------

Accept = Callable[[str, bool, int, Admission], str]


def accept_drive(source: str, valid: bool, echo: int, checked: Admission) -> str:
    drive = Drive(linear=0.1, angular=0.0, echo=echo) if valid else None
    return DRIVES.accept(DriveRequest({"known": "web"}.get(source, source), drive), checked)[1]


def accept_limit(source: str, valid: bool, echo: int, checked: Admission) -> str:
    message = Limit(echo=echo) if valid else None
    return LIMITS.accept(LimitRequest({"known": "fleet"}.get(source, source), message), checked)[1]


def accept_keepalive(source: str, valid: bool, echo: int, checked: Admission) -> str:
    message = Limit(echo=echo) if valid else None
    return KEPT.accept(LimitRequest({"known": "web"}.get(source, source), message), checked)[1]


@pytest.mark.parametrize("accept", [accept_drive, accept_limit, accept_keepalive])
@pytest.mark.parametrize(
    ("given", "now_ns", "reason"),
    [
        (("nobody", True, 41), 0, "unknown_source"),
        (("nobody", False, 41), 0, "unknown_source"),
        (("known", False, 41), 0, "not_a_request"),
        (("known", True, 40), 0, "late"),
        (("known", True, 43), 0, "late"),
        (("known", True, 41), AGE_NS + 1, "late"),
        (("known", True, 41), AGE_NS, ""),
        (("known", True, 42), AGE_NS + 1, ""),
    ],
)
def test_reasons_of_refusal(
    accept: Accept, given: tuple[str, bool, int], now_ns: int, reason: str
) -> None:
    assert accept(*given, Admission(BEAT, AGE_NS, now_ns)) == reason


def test_a_repeated_number_is_refused() -> None:
    assert request(request(DRIVES)[0], 1)[1] == "seq_not_rising"
    assert limit(limit(LIMITS)[0], None, 1)[1] == "seq_not_rising"
    assert keep(keep(KEPT)[0], 1)[1] == "seq_not_rising"


class Publishers(RuleBasedStateMachine):
    """Two publishers on one channel, whose numbers rise or not: what counts, and for how long."""

    def __init__(self) -> None:
        super().__init__()
        self.now_ns = NS_PER_S
        self.channel = DriveChannel()
        self.owner: tuple[int, int, int] | None = None  # boot, seq, time
        self.conflict_ns: int | None = None

    def expected(self, boot: int, seq: int) -> str:
        if self.owner is None:
            return ""
        age_ns = self.now_ns - self.owner[2]
        if boot != self.owner[0]:
            return "second_publisher" if age_ns <= TELEOP_NS else ""
        return "seq_not_rising" if seq <= self.owner[1] and age_ns <= AGE_NS else ""

    @rule(
        wait_ns=st.sampled_from(
            [edge + ns for edge in (0, TELEOP_NS, AGE_NS, CONFLICT_NS - 1) for ns in (0, 1)]
        ),
        boot=st.integers(1, 2),
        seq=st.integers(0, 4),
    )
    def send(self, wait_ns: int, boot: int, seq: int) -> None:
        self.now_ns += wait_ns
        reason, before = self.expected(boot, seq), replace(self.channel, overruled_by="web")
        goes_on = self.owner is not None and self.owner[0] == boot and seq > self.owner[1]
        message = Drive(linear=0.0, angular=0.0, echo=0, boot=boot, seq=seq)
        lease_s = TELEOP_NS / NS_PER_S
        self.channel, refused = before.accept(message, self.now_ns, lease_s, AGE_NS)
        assert refused == reason
        if reason == "second_publisher":
            self.conflict_ns = self.now_ns
        elif not reason:
            self.owner = boot, seq, self.now_ns
            assert self.channel.overruled_by == "web" * goes_on  # another publisher starts anew
        else:
            assert self.channel == before

    @rule(wait_ns=st.sampled_from([1, TELEOP_NS, CONFLICT_NS]))
    def wait(self, wait_ns: int) -> None:
        self.now_ns += wait_ns

    @invariant()
    def the_channel_is_that_of_its_owner(self) -> None:
        if self.owner is None:
            return
        assert (self.channel.boot, self.channel.seq, self.channel.lease_ns) == self.owner
        is_fresh = self.now_ns - self.owner[2] <= TELEOP_NS
        assert self.channel.is_fresh(self.now_ns, TELEOP_NS / NS_PER_S) is is_fresh
        since_ns = self.conflict_ns
        in_conflict = since_ns is not None and self.now_ns - since_ns < CONFLICT_NS
        assert self.channel.in_conflict(self.now_ns) is in_conflict


TestPublishers = Publishers.TestCase
TestPublishers.settings = settings(max_examples=40, stateful_step_count=30, deadline=None)


# --- the source in control ------------------------------------------------------------------


def test_two_publishers_bar_only_their_own_source() -> None:
    arbiter, _ = request(request(DRIVES, source="web")[0], source="web", boot=2)
    assert arbiter.conflict(0) == ["web"]
    assert request(arbiter, source="teleop")[0].conflict(0) == []
    assert request(arbiter, source="nav")[0].conflict(0) == ["web"]


@pytest.mark.parametrize(("gap_s", "neutral"), [(1.0, True), (1.1, False)])
def test_a_suspended_source_needs_a_neutral_request(gap_s: float, neutral: bool) -> None:
    """An SDK program after SIGSTOP and SIGCONT."""
    at_ns = round((SOURCES["teleop"].lease + gap_s) * NS_PER_S)
    drive = Drive(linear=0.5, angular=0.0, echo=43, seq=2, boot=1)
    now = Admission(BEAT.beat(at_ns), AGE_NS, at_ns)
    arbiter, refused = request(DRIVES, 1)[0].accept(DriveRequest("teleop", drive, at_ns), now)
    assert refused == ""
    assert arbiter.is_neutral("teleop") is neutral


@pytest.mark.parametrize(
    ("rested_ms", "gap_ms", "neutral"),
    [
        (0, 300, True),  # it stands, and the lease lives
        (300, 301, True),  # it stood until the lease was over, and rolls on
        (301, 302, False),
        (500, 900, False),  # it stood, and another source moves it
    ],
)
def test_a_source_whose_lease_was_over_at_a_standstill_resumes(
    rested_ms: int, gap_ms: int, neutral: bool
) -> None:
    arbiter = request(DRIVES, 1)[0].at_rest(rested_ms * MS + 1)
    at_ns = gap_ms * MS
    drive = Drive(linear=0.5, angular=0.0, echo=43, seq=2, boot=1)
    arbiter, refused = arbiter.accept(
        DriveRequest("teleop", drive, at_ns), Admission(BEAT.beat(at_ns), AGE_NS, at_ns)
    )
    assert refused == ""
    assert arbiter.is_neutral("teleop") is neutral


def test_a_zero_counts_that_was_received_after_the_last_bar() -> None:
    arbiter = request(request(DRIVES, 5)[0], 5, source="web", linear=0.5)[0]
    assert not arbiter.is_neutral("web")
    assert arbiter.is_neutral("teleop")
    assert arbiter.barred(4).is_neutral("teleop")
    assert not arbiter.barred(5).is_neutral("teleop")


def test_the_sources_that_request_zero_are_those_with_a_fresh_zero() -> None:
    arbiter, _ = request(request(DRIVES)[0], 1, "web", 0.1)
    assert arbiter.requesting_zero(1) == {"teleop"}
    assert arbiter.requesting_zero(TELEOP_NS + 1) == set()


def test_the_source_in_control_overrules_lower_ones_only() -> None:
    arbiter, lowest = DRIVES, request(DRIVES, source="nav")[0]
    assert [one.overruled(0) is one for one in (arbiter, lowest)] == [True, True]
    for source in ("teleop", "web", "nav"):
        arbiter, _ = request(arbiter, 1, source=source)
    arbiter = request(arbiter, 1, source="demo", linear=0.3)[0]
    assert arbiter.overruled(NS_PER_S).channels == arbiter.channels  # nobody holds it
    lower = {name: one for name, one in arbiter.channels.items() if name != "teleop"}
    overruled = replace(arbiter, channels=lower).overruled(1)
    states = {name: one.overruled_by for name, one in overruled.channels.items()}
    assert states == {"web": "", "demo": "web", "nav": "web"}
    assert [name for name in states if overruled.is_neutral(name)] == ["web"]
    again, _ = request(overruled, 2, source="nav", seq=9)
    assert (again.is_neutral("nav"), again.channels["nav"].overruled_by) == (True, "")
    again, _ = request(overruled, 2, source="demo", seq=9, linear=0.3)
    assert again.channels["demo"].overruled_by == "web"  # it asks for motion


def test_a_release_requests_no_other_motion() -> None:
    arbiter, _ = request(DRIVES, linear=0.5, release="forward")
    assert arbiter.channels["teleop"].requested == STILL
    assert arbiter.requests_motion(0)


# --- speed limits ---------------------------------------------------------------------------


def test_a_reason_shows_no_control_characters() -> None:
    assert limit(LIMITS, 0.2, reason="a\x07b.")[0].channels["lidar"].reason == r"a\u0007b."


def shown(limits: SpeedLimits, now_ns: int) -> dict[str, str]:
    """Return the texts of the causes that forbid motion, by name."""
    return {one.name: render(one.phrases) for one in limits.observations(now_ns)}


@pytest.mark.parametrize(
    ("linear", "angular", "stops"),
    [
        (0.0, None, True), (None, 0.0, True), (-0.0, 1.0, True), (5e-324, None, True),
        (ROUNDED_MPS, None, True), (None, ROUNDED_RADPS, True),
        (ROUNDED_MPS * 1.01, ROUNDED_RADPS * 1.01, False), (None, None, False),
    ],
)  # fmt: skip
def test_zero_is_a_protective_stop(
    linear: float | None, angular: float | None, stops: bool
) -> None:
    limits, _ = limit(LIMITS, linear, angular=angular, reason="PERSON.")
    assert shown(limits, 0) == ({"limit_stop": "Stopped by lidar: PERSON."} if stops else {})
    if stops:
        assert limits.limited(Twist(1.0, 1.0), 0) == (STILL, "lidar")
    assert shown(limits, LEASE_NS + 1).keys() == {"limit_silent"}
    both, _ = limit(limit(LIMITS, 0.0, reason="dog")[0], 0.0, source="fleet")
    assert shown(both, 0) == {"limit_stop": "Stopped by lidar: dog, fleet."}


def test_all_silent_sources_are_named() -> None:
    needed = LimitSource(lease=LEASE_S, silence="stop")
    both = SpeedLimits({"lidar": needed, "person": needed})
    assert shown(both, 0) == {"limit_silent": "No speed limit arrives from lidar, person."}


def test_states_of_limits() -> None:
    never = LimitState(
        source="lidar", linear=None, angular=None, reason="", age=None, silent=True, effect="stop",
        lease=LEASE_S, silence="stop",
    )  # fmt: skip
    assert LIMITS.states(None, 0)[0] == never
    assert [one.effect for one in LIMITS.states(None, 0)] == ["stop", "none"]
    limits, _ = limit(limit(LIMITS, 0.5, reason="person")[0], angular=0.3, source="fleet")
    lidar, fleet = limits.states("lidar", LEASE_NS)
    assert lidar == LimitState(
        source="lidar", linear=0.5, angular=None, reason="person", age=LEASE_S, silent=False,
        effect="slow", lease=LEASE_S, silence="stop",
    )  # fmt: skip
    assert (fleet.linear, fleet.angular, fleet.effect, fleet.silent) == (None, 0.3, "none", False)
    lidar, fleet = limits.states("lidar", LEASE_NS + 1)
    assert (lidar.linear, lidar.reason, lidar.silent, lidar.effect) == (None, "", True, "stop")
    assert (fleet.angular, fleet.silent, fleet.effect) == (None, True, "none")
    assert limit(LIMITS, 0.0)[0].states("lidar", 0)[0].effect == "stop"
    assert SpeedLimits({}).states(None, 0) == ()
    assert LimitChannel() == LimitChannel(linear=math.inf, angular=math.inf, reason="")
    assert LimitChannel(lease_ns=3 * NS_PER_S).age_s(4_500 * MS) == 1.5


CAPS, SPEEDS = st.none() | st.floats(0, 3), st.floats(-2, 2)


@pytest.mark.parametrize(("lease_s", "until_ns"), [(0.2, CONFLICT_NS), (1.0, NS_PER_S)])
def test_a_second_limiting_publisher_stops_for_the_lease_and_half_a_second_at_least(
    lease_s: float, until_ns: int
) -> None:
    limits = SpeedLimits({"lidar": LimitSource(lease=lease_s, silence="ignore")})
    limits, refused = limit(limit(limits)[0], boot=2)
    assert refused == "second_publisher"
    assert limits.conflicts(until_ns - 1) == ["limit lidar"]
    assert limits.conflicts(until_ns) == []


@given(st.lists(st.tuples(CAPS, CAPS), min_size=2, max_size=2), SPEEDS, SPEEDS)
def test_no_limit_raises_any_speed_or_bends_the_curve(
    caps: list[tuple[float | None, float | None]], linear: float, angular: float
) -> None:
    limits, asked = LIMITS, Twist(linear, angular)
    for source, (cap, turn) in zip(LIMITERS, caps, strict=True):
        limits, _ = limit(limits, cap, angular=turn, source=source)
    twist, by = limits.limited(asked, 0)
    assert (by is None) == (twist == asked)
    for cap, turn in caps:
        assert abs(twist.linear) <= min(abs(linear), math.inf if cap is None else cap) + 1e-12
        assert abs(twist.angular) <= min(abs(angular), math.inf if turn is None else turn) + 1e-12
    assert twist.linear * angular == pytest.approx(twist.angular * linear, abs=1e-9)


# --- keepalives -----------------------------------------------------------------------------


LOST = {"estop_keepalive": "The emergency stop is no longer kept alive by pendant."}


def alive(keepalives: SpeedLimits, now_ns: int) -> bool:
    return not keepalives.states(None, now_ns)[0].silent


def test_a_keepalive_counts_from_the_echoed_heartbeat() -> None:
    keepalives, _ = keep(KEPT, 900 * MS, late_ns=50 * MS)  # held for 0.9 s
    assert [alive(keepalives, now_ns) for now_ns in (TIMEOUT_NS, TIMEOUT_NS + 1)] == [True, False]
    keepalives, _ = keep(keepalives, 950 * MS, echo=42, seq=2)
    later_ns = TIMEOUT_NS + 300 * MS
    assert [alive(keepalives, now_ns) for now_ns in (later_ns, later_ns + 1)] == [True, False]


@pytest.mark.parametrize("now_ns", [100 * MS, TIMEOUT_NS, TIMEOUT_NS + 1])
def test_another_program_under_the_name_is_a_loss_at_any_time(now_ns: int) -> None:
    other, refused = keep(keep(KEPT)[0], now_ns, boot=2, echo=42)
    assert refused == ("second_publisher" if now_ns <= TIMEOUT_NS else "")
    assert shown(other, now_ns) == LOST
    assert other.channels["pendant"].in_conflict(now_ns + CONFLICT_NS - 1)
    assert other.conflicts(now_ns) == []  # the cause that latches says it
    assert other.states(None, now_ns)[0].effect == "brake"


@pytest.mark.parametrize(("now_ns", "is_lost"), [(TIMEOUT_NS, False), (TIMEOUT_NS + 1, True)])
def test_a_gap_is_a_loss_although_the_program_is_the_same(now_ns: int, is_lost: bool) -> None:
    later, refused = keep(keep(KEPT)[0], now_ns, echo=42, seq=2)
    assert refused == ""
    assert shown(later, now_ns) == (LOST if is_lost else {})
    assert alive(later, now_ns) is not is_lost


def test_a_name_that_was_never_received_is_missing_and_not_lost() -> None:
    assert KEPT.missing == ["pendant", "web"]
    assert shown(KEPT, 0) == {}
    keepalives, _ = keep(KEPT)
    assert keepalives.missing == ["web"]
    assert shown(keepalives, 0) == {}
    pendant, web = keepalives.states(None, 500 * MS)
    assert (pendant.age, pendant.silent, pendant.effect) == (0.5, False, "none")
    assert (web.age, web.silent, web.effect) == (None, True, "stop")
    assert (web.lease, web.silence) == (TIMEOUT_S, "latch")
    both, _ = keep(keepalives, source="web")
    assert shown(both, 2 * TIMEOUT_NS) == {  # neither a protective stop nor a silent limit
        "estop_keepalive": "The emergency stop is no longer kept alive by pendant, web.",
    }


def test_a_sign_of_life_may_have_a_cap_that_holds_as_long() -> None:
    keepalives, _ = keep(KEPT, linear=0.2)
    assert keepalives.limited(Twist(1.0), TIMEOUT_NS) == (Twist(0.2), "pendant")
    assert keepalives.limited(Twist(1.0), TIMEOUT_NS + 1) == (Twist(1.0), None)
    assert shown(keepalives, TIMEOUT_NS + 1) == LOST
