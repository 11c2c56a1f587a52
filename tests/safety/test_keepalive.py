"""Emergency stops that must be kept alive."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from common.heartbeat import Heartbeat
from common.messages import EstopKeepalive, KeepaliveState
from services.safety.config import Safety
from services.safety.core.inputs import KeepaliveRequest
from services.safety.core.sources import CONFLICT_NS, Admission, Keepalives
from tests.safety.policy_fixture import PolicyFixture

MS = 1_000_000
TIMEOUT_S, TIMEOUT_NS = 1.0, NS_PER_S
BEAT = Heartbeat(40).beat(0).beat(300 * MS)  # sent 41 at 0, 42 at 0.3 s
EMPTY = Keepalives(("pendant", "web"), TIMEOUT_S)
NEEDED = Safety(estop_keepalive=("pendant",))


def put(
    keepalives: Keepalives,
    now_ns: int = 0,
    *,
    source: str = "pendant",
    echo: int = 41,
    seq: int = 1,
    boot: int = 1,
    late_ns: int = 0,
) -> tuple[Keepalives, str]:
    message = EstopKeepalive(echo=echo, seq=seq, boot=boot)
    request = KeepaliveRequest(source, message, now_ns)
    return keepalives.accept(request, Admission(BEAT, TIMEOUT_NS, now_ns + late_ns))


def alive(keepalives: Keepalives, now_ns: int) -> bool:
    return keepalives.states(now_ns)[0].alive


# --- admission ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("source", "echo", "now_ns", "reason"),
    [
        ("nobody", 41, 0, "unknown_source"),
        ("pendant", 41, TIMEOUT_NS, ""),
        ("pendant", 41, TIMEOUT_NS + 1, "late"),
        ("pendant", 43, 0, "late"),
        ("web", 41, 0, ""),
    ],
)
def test_reasons_of_refusal(source: str, echo: int, now_ns: int, reason: str) -> None:
    keepalives, refused = put(EMPTY, now_ns, source=source, echo=echo)
    assert refused == reason
    assert (keepalives == EMPTY) == bool(reason)


def test_a_wrong_type_is_refused() -> None:
    request = KeepaliveRequest("pendant", None)
    assert EMPTY.accept(request, Admission(BEAT, TIMEOUT_NS, 0)) == (EMPTY, "not_a_request")


def test_the_time_counts_from_the_echoed_heartbeat() -> None:
    keepalives, _ = put(EMPTY, 900 * MS, late_ns=50 * MS)  # held for 0.9 s
    assert alive(keepalives, TIMEOUT_NS)
    assert not alive(keepalives, TIMEOUT_NS + 1)
    keepalives, _ = put(keepalives, 950 * MS, echo=42, seq=2)
    assert alive(keepalives, TIMEOUT_NS + 300 * MS)
    assert not alive(keepalives, TIMEOUT_NS + 300 * MS + 1)


def test_a_repeated_message_is_refused_and_proves_nothing() -> None:
    keepalives, _ = put(EMPTY)
    again, refused = put(keepalives, 500 * MS, echo=42)
    assert (refused, again) == ("seq_not_rising", keepalives)


@pytest.mark.parametrize("now_ns", [100 * MS, TIMEOUT_NS, TIMEOUT_NS + 1])
def test_another_program_under_the_name_is_a_loss_at_any_time(now_ns: int) -> None:
    keepalives, _ = put(EMPTY)
    other, refused = put(keepalives, now_ns, boot=2, echo=42)
    assert refused == ("second_publisher" if now_ns <= TIMEOUT_NS else "")
    seen = other.observation(now_ns)
    assert (seen.name, seen.present, seen.token) == ("estop_keepalive", True, (0, now_ns))
    assert seen.text == "The emergency stop is no longer kept alive by pendant."
    assert other.channels["pendant"].in_conflict(now_ns + CONFLICT_NS - 1)


def test_a_gap_is_a_loss_although_the_program_is_the_same() -> None:
    keepalives, _ = put(EMPTY)
    later, refused = put(keepalives, TIMEOUT_NS + 1, echo=42, seq=2)
    assert refused == ""
    assert later.observation(TIMEOUT_NS + 1).present
    assert not alive(later, TIMEOUT_NS + 1)
    on_time, _ = put(keepalives, TIMEOUT_NS, echo=42, seq=2)
    assert not on_time.observation(TIMEOUT_NS).present


def test_a_name_that_was_never_heard_is_missing_and_not_lost() -> None:
    assert EMPTY.missing == ["pendant", "web"]
    assert not EMPTY.observation(0).present
    keepalives, _ = put(EMPTY)
    assert keepalives.missing == ["web"]
    assert not keepalives.observation(0).present
    assert keepalives.states(500 * MS) == (
        KeepaliveState(source="pendant", age=0.5, alive=True, timeout=TIMEOUT_S),
        KeepaliveState(source="web", age=None, alive=False, timeout=TIMEOUT_S),
    )


def test_all_lost_names_are_in_the_text() -> None:
    keepalives, _ = put(put(EMPTY)[0], source="web")
    text = keepalives.observation(2 * TIMEOUT_NS).text
    assert text == "The emergency stop is no longer kept alive by pendant, web."


# --- the whole decision ---------------------------------------------------------------------


def kept(fixture: PolicyFixture, linear: float, seconds: float) -> None:
    """Drive, with a keepalive ten times a second."""
    for _ in range(round(seconds / 0.1)):
        fixture.keepalive()
        fixture.drive(linear, seconds=0.1)


def running() -> PolicyFixture:
    fixture = PolicyFixture(NEEDED)
    fixture.tick(40)
    kept(fixture, 0.0, 1.0)
    kept(fixture, 0.5, 1.0)
    assert fixture.verdict.command == "run", fixture.state.latches
    return fixture


def test_it_inhibits_until_it_is_heard_for_the_first_time() -> None:
    fixture = PolicyFixture(NEEDED)
    fixture.drive(0.0, seconds=2.0)
    fixture.drive(0.5, seconds=0.5)
    assert fixture.verdict.name == "inhibited"
    assert "emergency stop keepalive of pendant" in fixture.state.latches["starting"].text
    assert not fixture.latched()
    kept(fixture, 0.5, 1.0)
    assert fixture.verdict.command == "stop"  # not before a neutral request
    kept(fixture, 0.0, 0.3)
    kept(fixture, 0.5, 0.3)
    assert fixture.verdict.command == "run"


def test_its_silence_brakes_and_latches_until_it_is_back_and_reset() -> None:
    fixture = running()
    assert fixture.drive(0.5, seconds=0.8).command == "run"
    assert fixture.drive(0.5, seconds=0.3).command == "brake"
    fixture.linear = 0.0
    fixture.tick(50)
    assert fixture.reset() == (
        "Still present: The emergency stop is no longer kept alive by pendant."
    )
    for _ in range(10):
        fixture.keepalive()
        fixture.tick(5)
    assert fixture.verdict.command == "brake"
    assert fixture.reset() == ""
    fixture.linear = None
    kept(fixture, 0.5, 0.4)
    assert fixture.verdict.command == "stop"
    kept(fixture, 0.0, 0.8)
    kept(fixture, 0.5, 0.3)
    assert fixture.verdict.command == "run"


def test_messages_that_a_proxy_holds_do_not_keep_it_alive() -> None:
    fixture = running()
    echo = fixture.echo
    for _ in range(12):
        fixture.keepalive(echo=echo)
        fixture.drive(0.5, seconds=0.1)
    assert fixture.verdict.command == "brake"
    assert fixture.keepalive(echo=echo).refused == "keepalive_late"


def test_a_second_program_under_the_name_latches() -> None:
    fixture = running()
    fixture.keepalive_boot = 67
    assert fixture.keepalive().refused == "keepalive_second_publisher"
    assert fixture.verdict.command == "brake"
    assert fixture.state.verdict.name == "brake"


def test_an_unknown_name_does_nothing() -> None:
    fixture = running()
    assert fixture.keepalive("stranger").refused == "keepalive_unknown_source"
    wrong = fixture.decide(KeepaliveRequest("pendant", None, fixture.now_ns))
    assert (wrong.refused, wrong.command) == ("keepalive_not_a_request", "run")


def test_without_names_nothing_is_expected() -> None:
    fixture = PolicyFixture().running()
    assert fixture.published().estop_keepalives == ()
    assert fixture.drive(0.5, seconds=3.0).command == "run"


@settings(max_examples=30)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(["beat", "old echo", "again", "rival", "silent"]), st.integers(1, 30)
        ),
        max_size=8,
    )
)
def test_no_run_later_than_the_timeout_after_the_heartbeat_that_was_echoed(
    events: list[tuple[str, int]],
) -> None:
    fixture = running()
    proven_ns, first, latched = fixture.now_ns, fixture.echo, False
    fixture.keepalive()
    for kind, ticks in events:
        for _ in range(ticks):
            fixture.tick()
            if kind == "beat":
                if fixture.now_ns - proven_ns > TIMEOUT_NS:
                    latched = True
                fixture.keepalive()
                proven_ns = fixture.now_ns
            elif kind == "old echo":
                fixture.keepalive(echo=first)
            elif kind == "again":
                fixture.keepalive_seq -= 1
                fixture.keepalive()
            elif kind == "rival":
                fixture.keepalive_boot += 1
                fixture.keepalive()
                fixture.keepalive_boot -= 1
                latched = True
            fixture.request(0.5)
            latched = latched or fixture.now_ns - proven_ns > TIMEOUT_NS
            assert not (latched and fixture.verdict.command != "brake"), (kind, ticks)
