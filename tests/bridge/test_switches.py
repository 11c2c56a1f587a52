"""The board's emergency brakes: on and echoed."""

import pytest

from common.freshness import NS_PER_S
from common.wire.commands import BumperBrakeSet, UltrasonicBrakeSet
from services.bridge.switches import (
    AGAIN_NS,
    ASK_NS,
    UNECHOED,
    Switches,
    on_echo,
    on_request,
    on_return,
    on_tick,
)

BOTH_ON = Switches(ultrasonic=True, bumper=True)


def test_a_return_asks_for_both_until_they_echo() -> None:
    switches, frames = on_tick(on_return(NS_PER_S), NS_PER_S)
    assert frames == [UltrasonicBrakeSet(True), BumperBrakeSet(True)]
    assert on_tick(switches, NS_PER_S + ASK_NS - 1)[1] == []
    switches = on_echo(switches, True, None)
    switches, frames = on_tick(switches, NS_PER_S + ASK_NS)
    assert frames == [BumperBrakeSet(True)]
    assert not switches.verified
    switches = on_echo(switches, None, True)
    assert switches.verified
    assert switches.settled
    asked = switches.asked_ns or 0
    assert on_tick(switches, asked + AGAIN_NS - 1)[1] == []
    assert len(on_tick(switches, asked + AGAIN_NS)[1]) == 2


@pytest.mark.parametrize(
    ("ultrasonic", "bumper", "verified"),
    [(True, True, True), (True, False, False), (False, True, False), (None, True, False),
     (True, None, False)],
)  # fmt: skip
def test_verified_means_both_on_by_the_boards_own_word(
    ultrasonic: bool | None, bumper: bool | None, verified: bool
) -> None:
    assert Switches(ultrasonic=ultrasonic, bumper=bumper).verified is verified


def test_an_operator_may_switch_one_off_but_then_it_is_not_verified() -> None:
    switches = on_request(BOTH_ON, False, None, NS_PER_S)
    assert not switches.settled
    switches, frames = on_tick(switches, NS_PER_S)
    assert frames == [UltrasonicBrakeSet(False)]
    switches = on_echo(switches, False, None)
    assert switches.settled
    assert not switches.verified
    assert switches.bumper is True


def test_a_request_for_the_bumper_leaves_the_ultrasonic_alone() -> None:
    switches = on_request(BOTH_ON, None, False, NS_PER_S)
    assert (switches.want_ultrasonic, switches.want_bumper) == (True, False)
    assert (switches.ultrasonic, switches.bumper) == (True, None)
    assert on_tick(switches, NS_PER_S)[1] == [BumperBrakeSet(False)]


def test_a_board_that_echoes_the_other_position_is_asked_again() -> None:
    switches, _ = on_tick(on_return(NS_PER_S), NS_PER_S)
    switches = on_echo(switches, False, False)
    assert not switches.settled
    assert len(on_tick(switches, NS_PER_S + ASK_NS)[1]) == 2


def sends(switches: Switches, count: int, now_ns: int = NS_PER_S) -> Switches:
    """Run ticks that send the commands ``count`` times."""
    for number in range(count):
        switches, frames = on_tick(switches, now_ns + number * AGAIN_NS)
        assert frames
    return switches


@pytest.mark.parametrize("echoes", [(None, None), (True, None), (None, True)])
def test_an_on_that_is_no_longer_echoed_is_not_verified(
    echoes: tuple[bool | None, bool | None],
) -> None:
    switches = sends(BOTH_ON, UNECHOED)
    assert switches.verified
    switches = sends(on_echo(switches, *echoes), 1, 9 * NS_PER_S)
    assert (switches.ultrasonic, switches.bumper) == echoes
    assert not switches.verified
    assert switches.unechoed, "enough where the settings accept that"
    assert on_echo(switches, True, True).verified


def test_an_echo_counts_for_the_next_sends() -> None:
    switches = BOTH_ON
    for second in range(1, 9):
        switches = sends(on_echo(switches, True, True), UNECHOED, second * NS_PER_S)
    assert switches.verified


def test_an_off_lasts_until_an_on_is_echoed() -> None:
    for switches in (
        Switches(ultrasonic=False, bumper=True),
        Switches(ultrasonic=True, bumper=False),
    ):
        assert not sends(switches, 3 * UNECHOED).unechoed
