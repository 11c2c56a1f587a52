"""Speed limits by third parties: admission, caps, protective stops and silence."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common import codec
from common.errors import MessageError
from common.heartbeat import Heartbeat
from common.messages import Limit, LimitState
from common.motion import ROUNDED_MPS, ROUNDED_RADPS, STILL, Twist
from services.safety.config import LimitSource
from services.safety.core.inputs import LimitRequest
from services.safety.core.sources import (
    CONFLICT_NS,
    Admission,
    LimitChannel,
    SpeedLimits,
    printable,
)

LEASE_S, LEASE_NS, AGE_NS = 0.5, 500_000_000, 400_000_000
SOURCES = {
    "lidar": LimitSource(lease=LEASE_S, silence="stop"),
    "fleet": LimitSource(lease=LEASE_S, silence="ignore"),
}
BEAT = Heartbeat(40).beat(0)  # sent 41 at time 0
EMPTY = SpeedLimits(SOURCES)


def put(
    limits: SpeedLimits,
    now_ns: int = 0,
    *,
    source: str = "lidar",
    linear: float | None = None,
    angular: float | None = None,
    reason: str = "",
    seq: int = 1,
    boot: int = 1,
    echo: int = 41,
) -> tuple[SpeedLimits, str]:
    limit = Limit(linear=linear, angular=angular, reason=reason, echo=echo, seq=seq, boot=boot)
    request = LimitRequest(source, limit, now_ns)
    return limits.accept(request, Admission(BEAT, AGE_NS, min(now_ns, AGE_NS)))


def with_limit(
    linear: float | None = None,
    angular: float | None = None,
    reason: str = "",
    source: str = "lidar",
) -> SpeedLimits:
    limits, refused = put(EMPTY, linear=linear, angular=angular, reason=reason, source=source)
    assert refused == ""
    return limits


# --- admission ------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_non_finite_cap_is_refused(value: float) -> None:
    assert put(EMPTY, linear=value) == (EMPTY, "not_finite")
    assert put(EMPTY, angular=value) == (EMPTY, "not_finite")


def test_no_cap_is_a_limit_too() -> None:
    limits = with_limit()
    assert limits.limited(Twist(1.0, 1.0), 0) == (Twist(1.0, 1.0), None)
    assert [one.present for one in limits.observations(0)] == [False, False]


@pytest.mark.parametrize(
    ("source", "limit", "reason"),
    [
        ("nobody", Limit(echo=41), "unknown_source"),
        ("nobody", None, "unknown_source"),
        ("lidar", None, "not_a_request"),
        ("lidar", Limit(echo=40), "late"),
        ("lidar", Limit(echo=42), "late"),
        ("lidar", Limit(echo=41, seq=0, boot=1), ""),
    ],
)
def test_reasons_of_refusal(source: str, limit: Limit | None, reason: str) -> None:
    limits, refused = EMPTY.accept(LimitRequest(source, limit, 0), Admission(BEAT, AGE_NS, 0))
    assert refused == reason
    assert (limits == EMPTY) == bool(reason)


@pytest.mark.parametrize(("now_ns", "reason"), [(AGE_NS, ""), (AGE_NS + 1, "late")])
def test_a_late_echo_is_refused(now_ns: int, reason: str) -> None:
    request = LimitRequest("lidar", Limit(echo=41), 0)
    assert EMPTY.accept(request, Admission(BEAT, AGE_NS, now_ns))[1] == reason


def test_a_repeated_or_older_limit_changes_nothing() -> None:
    limits, _ = put(EMPTY, linear=0.2, seq=5)
    for seq in (4, 5):
        again, refused = put(limits, linear=0.9, seq=seq)
        assert (again, refused) == (limits, "seq_not_rising")
    assert put(limits, linear=0.9, seq=6)[0].channels["lidar"].linear == 0.9


def test_a_second_publisher_is_refused_and_reported_while_the_first_lives() -> None:
    limits, _ = put(EMPTY, linear=0.2)
    other, refused = put(limits, LEASE_NS, linear=0.9, boot=2)
    assert refused == "second_publisher"
    assert other.channels["lidar"].linear == 0.2
    assert other.conflicts(LEASE_NS + CONFLICT_NS - 1) == ["limit lidar"]
    assert other.conflicts(LEASE_NS + CONFLICT_NS) == []
    taken, refused = put(limits, LEASE_NS + 1, linear=0.9, boot=2)
    assert (refused, taken.channels["lidar"].linear) == ("", 0.9)
    assert taken.conflicts(LEASE_NS + 1) == []


@pytest.mark.parametrize(
    "payload",
    [
        {"echo": 1, "linear": -0.1},
        {"echo": 1, "angular": -1},
        {"echo": 1, "linear": "fast"},
        {"echo": 1, "linear": True},
        {"echo": 1, "reason": "x" * 81},
        {"echo": 1, "reason": 5},
        {"linear": 0.1},
    ],
)
def test_a_wrong_type_is_no_limit(payload: dict[str, object]) -> None:
    with pytest.raises(MessageError, match="not a Limit"):
        codec.decode(codec._encoder.encode(payload), Limit)


def test_a_reason_shows_no_control_characters() -> None:
    assert printable("person\tat\x1b[2J 2 m\u202e\n") == "person at [2J 2 m"
    limits = with_limit(0.2, reason="a\x07b.")
    assert limits.channels["lidar"].reason == "a b."
    assert limits.channels["lidar"].because == ": a b"


# --- caps -----------------------------------------------------------------------------------


def test_a_cap_keeps_the_curve() -> None:
    limits = with_limit(0.25)
    assert limits.limited(Twist(-1.0, 0.4), 0) == (Twist(-0.25, 0.1), "lidar")
    assert with_limit(None, 0.1).limited(Twist(1.0, 0.4), 0) == (Twist(0.25, 0.1), "lidar")
    assert limits.limited(Twist(0.25, 2.0), 0) == (Twist(0.25, 2.0), None)
    assert limits.channels["lidar"].because == ""


def test_the_tightest_source_is_named() -> None:
    limits, _ = put(with_limit(0.5), linear=0.2, source="fleet")
    assert limits.limited(Twist(1.0), 0) == (Twist(0.2), "fleet")
    limits, _ = put(with_limit(0.2), linear=0.5, source="fleet")
    assert limits.limited(Twist(1.0), 0) == (Twist(0.2), "lidar")


def test_a_cap_ends_with_its_lease() -> None:
    limits = with_limit(0.25)
    assert limits.limited(Twist(1.0), LEASE_NS)[0] == Twist(0.25)
    assert limits.limited(Twist(1.0), LEASE_NS + 1) == (Twist(1.0), None)


@pytest.mark.parametrize(
    ("linear", "angular", "stops"),
    [
        (0.0, None, True),
        (None, 0.0, True),
        (-0.0, 1.0, True),
        (5e-324, None, True),
        (ROUNDED_MPS, None, True),
        (None, ROUNDED_RADPS, True),
        (ROUNDED_MPS * 1.01, ROUNDED_RADPS * 1.01, False),
        (None, None, False),
    ],
)
def test_zero_is_a_protective_stop(
    linear: float | None, angular: float | None, stops: bool
) -> None:
    limits = with_limit(linear, angular, "person at 1 m")
    stop, silent = limits.observations(0)
    assert (stop.name, stop.present, stop.token) == ("limit_stop", stops, (0, 0))
    assert not silent.present
    if stops:
        assert stop.text == "Stopped by lidar: person at 1 m."
        assert limits.limited(Twist(1.0, 1.0), 0) == (STILL, "lidar")
    assert not next(limits.observations(LEASE_NS + 1)).present


def test_all_sources_that_stop_are_named() -> None:
    limits, _ = put(with_limit(0.0, reason="dog"), linear=0.0, source="fleet")
    assert next(limits.observations(0)).text == "Stopped by lidar: dog, fleet."


CAPS = st.none() | st.floats(0, 3)
SPEEDS = st.floats(-2, 2)


@given(st.lists(st.tuples(CAPS, CAPS), min_size=2, max_size=2), SPEEDS, SPEEDS)
def test_no_limit_raises_any_speed_or_bends_the_curve(
    caps: list[tuple[float | None, float | None]], linear: float, angular: float
) -> None:
    limits, asked = EMPTY, Twist(linear, angular)
    for source, (cap, turn) in zip(SOURCES, caps, strict=True):
        limits, _ = put(limits, linear=cap, angular=turn, source=source)
    twist, by = limits.limited(asked, 0)
    assert (by is None) == (twist == asked)
    for cap, turn in caps:
        assert abs(twist.linear) <= min(abs(linear), math.inf if cap is None else cap) + 1e-12
        assert abs(twist.angular) <= min(abs(angular), math.inf if turn is None else turn) + 1e-12
    assert twist.linear * angular == pytest.approx(twist.angular * linear, abs=1e-9)


# --- silence --------------------------------------------------------------------------------


def test_without_sources_nothing_is_limited_or_observed() -> None:
    nothing = SpeedLimits({})
    assert list(nothing.observations(0)) == []
    assert nothing.states(None, 0) == ()
    assert nothing.limited(Twist(1.0), 0) == (Twist(1.0), None)


def test_silence_stops_from_the_start_and_after_each_lease() -> None:
    _, silent = EMPTY.observations(0)
    assert (silent.name, silent.present, silent.token) == ("limit_silent", True, (0, 0))
    assert silent.text == "No speed limit arrives of lidar."
    limits = with_limit()
    assert [one.present for one in limits.observations(LEASE_NS)] == [False, False]
    assert [one.present for one in limits.observations(LEASE_NS + 1)] == [False, True]


def test_states_are_published() -> None:
    never = LimitState(
        source="lidar", linear=None, angular=None, reason="", age=None, silent=True, effect="stop"
    )
    assert EMPTY.states(None, 0)[0] == never
    assert [one.effect for one in EMPTY.states(None, 0)] == ["stop", "none"]
    limits, _ = put(with_limit(0.5, reason="person"), angular=0.3, source="fleet")
    lidar, fleet = limits.states("lidar", LEASE_NS)
    assert lidar == LimitState(
        source="lidar", linear=0.5, angular=None, reason="person", age=LEASE_S, silent=False,
        effect="slow",
    )  # fmt: skip
    assert (fleet.linear, fleet.angular, fleet.effect, fleet.silent) == (None, 0.3, "none", False)
    lidar, fleet = limits.states("lidar", LEASE_NS + 1)
    assert (lidar.linear, lidar.reason, lidar.silent, lidar.effect) == (None, "", True, "stop")
    assert (fleet.angular, fleet.silent, fleet.effect) == (None, True, "none")
    assert with_limit(0.0).states("lidar", 0)[0].effect == "stop"
    assert LimitChannel() == LimitChannel(linear=math.inf, angular=math.inf, reason="")


# --- conflicts, ages and texts of several sources ---------------------------------------------


def test_a_conflict_lasts_for_the_lease_of_the_source() -> None:
    longer = LimitSource(lease=1.0, silence="ignore")
    limits, _ = put(SpeedLimits({"lidar": longer}), boot=1)
    limits, refused = put(limits, boot=2)
    assert refused == "second_publisher"
    assert limits.conflicts(999_999_999) == ["limit lidar"]
    assert next(limits.observations(999_999_999)).text == "Stopped by lidar: two publishers."
    assert limits.conflicts(1_000_000_000) == []


def test_the_age_counts_from_the_reception() -> None:
    assert LimitChannel(received_ns=3_000_000_000).age_s(4_500_000_000) == 1.5


def test_all_silent_sources_are_named() -> None:
    silent = LimitSource(lease=LEASE_S, silence="stop")
    _, silence = SpeedLimits({"lidar": silent, "fleet": silent}).observations(0)
    assert silence.text == "No speed limit arrives of lidar, fleet."


def test_only_the_full_stop_of_a_reason_is_dropped() -> None:
    stop, _ = with_limit(linear=0.0, reason="BOX.").observations(0)
    assert stop.text == "Stopped by lidar: BOX."
