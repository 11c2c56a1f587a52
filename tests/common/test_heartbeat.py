"""The age limit of an echo, and the text of a refusal."""

from msgspec import structs

from common.freshness import NS_PER_S
from common.heartbeat import AHEAD, CAPACITY, MAX_CALL_AGE_NS, Echoes, Heartbeat
from t2.words import render
from tests.factories import safety_state

START = Heartbeat(1000)
STATE = safety_state(heartbeat=7, boot=3)


def test_an_echo_counts_up_to_its_limit() -> None:
    heartbeat = START.beat(5 * NS_PER_S)
    assert heartbeat.number == 1001
    assert not heartbeat.is_late(1001, 6 * NS_PER_S, NS_PER_S)
    assert heartbeat.is_late(1001, 6 * NS_PER_S + 1, NS_PER_S)
    assert render(heartbeat.refusal(1001, 6 * NS_PER_S)) == ""
    assert "1.5 s old, allowed is 1 s" in render(heartbeat.refusal(1001, 13 * NS_PER_S // 2))


def test_an_unknown_or_missing_echo_is_refused() -> None:
    heartbeat = START.beat(5 * NS_PER_S)
    assert heartbeat.is_late(1000, 5 * NS_PER_S, NS_PER_S)
    assert render(heartbeat.refusal(1000, 5 * NS_PER_S)) == (
        "The call refers to an unknown state of safety: look again, then repeat it."
    )
    assert render(heartbeat.refusal(None, 5 * NS_PER_S)) == (
        "The call carries no echo of safety's heartbeat: send the newest SafetyState.heartbeat "
        "as `echo`."
    )


def test_heartbeats_rise_and_are_forgotten_in_the_end() -> None:
    beat = Heartbeat(1000)
    assert beat.is_late(1000, 0, 10)
    for now_ns in range(CAPACITY + 5):
        beat = beat.beat(now_ns)
    assert beat.number == 1000 + CAPACITY + 5
    assert len(beat.sent) == CAPACITY
    assert not beat.is_late(beat.number, CAPACITY + 4 + 10, 10)
    assert beat.is_late(beat.number, CAPACITY + 4 + 11, 10)
    assert beat.is_late(1001, 0, 10**9)


def test_echoes_have_the_time_when_their_state_was_received() -> None:
    echoes = Echoes()
    assert "no echo" in render(echoes.refusal(None, 0))
    assert "unknown" in render(echoes.refusal(7, 0))
    echoes = echoes.received(STATE, 100)
    assert render(echoes.refusal(7, 100 + MAX_CALL_AGE_NS)) == ""
    assert "allowed is 1 s" in render(echoes.refusal(7, 101 + MAX_CALL_AGE_NS))
    assert "unknown" in render(echoes.refusal(6, 100))
    newer = echoes.received(structs.replace(STATE, heartbeat=8), 100 + MAX_CALL_AGE_NS)
    assert "allowed is 1 s" in render(newer.refusal(7, 101 + MAX_CALL_AGE_NS))
    assert render(newer.refusal(8, 101 + MAX_CALL_AGE_NS)) == ""


def test_another_start_of_safety_makes_old_echoes_unknown() -> None:
    echoes = (
        Echoes().received(STATE, 100).received(structs.replace(STATE, heartbeat=900, boot=4), 200)
    )
    assert "unknown" in render(echoes.refusal(7, 200))
    assert render(echoes.refusal(900, 200)) == ""


def test_an_echo_may_be_slightly_ahead_of_the_newest_state() -> None:
    echoes = Echoes().received(STATE, 100)
    assert render(echoes.refusal(7 + AHEAD, 100)) == ""
    assert "unknown" in render(echoes.refusal(8 + AHEAD, 100))
    assert "allowed is 1 s" in render(
        echoes.refusal(8, 101 + MAX_CALL_AGE_NS)
    )  # safety is silent now
