"""The table of causes, once more and by hand: no mutation of it goes unseen."""

import pytest

from common.messages import Action
from services.safety.core.causes import RULES, Clears, bars_motion, severity, wants_neutral

RESET, SETTLED, NEUTRAL, AT_ONCE = Clears.RESET, Clears.SETTLED, Clears.NEUTRAL, Clears.AT_ONCE
TABLE: list[tuple[str, Action, Clears]] = [
    ("contact", "brake", RESET),
    ("estop", "brake", RESET),
    ("estop_reader", "brake", RESET),
    ("estop_keepalive", "brake", RESET),
    ("predecessor", "brake", RESET),
    ("runaway", "brake", RESET),
    ("uncommanded_motion", "brake", RESET),
    ("not_stopping", "brake", SETTLED),
    ("driver_left", "stop", RESET),
    ("driver_right", "stop", RESET),
    ("flapping", "stop", RESET),
    ("leaving", "stop", SETTLED),
    ("starting", "stop", SETTLED),
    ("link", "stop", SETTLED),
    ("switches", "stop", SETTLED),
    ("bumper", "stop", SETTLED),
    ("silent", "stop", SETTLED),
    ("unarmed", "stop", SETTLED),
    ("limit_stop", "stop", NEUTRAL),
    ("limit_silent", "stop", NEUTRAL),
    ("two_publishers", "stop", AT_ONCE),
    ("neutral", "stop", AT_ONCE),
    ("blocked", "stop", AT_ONCE),
    ("no_request", "stop", AT_ONCE),
    ("release", "slow", AT_ONCE),
    ("bumper_lossy", "slow", AT_ONCE),
    ("limit", "slow", AT_ONCE),
    ("obstacle", "slow", AT_ONCE),
    ("sonar", "slow", AT_ONCE),
]


def test_the_table() -> None:
    assert [(rule.name, rule.action, rule.clears) for rule in RULES] == TABLE


def test_a_brake_is_worse_than_a_stop_and_a_stop_than_slow() -> None:
    names = [name for name, _, _ in TABLE]
    assert sorted(names, key=severity) == names
    worst = {action: severity(name)[0] for name, action, _ in TABLE}
    assert worst["brake"] < worst["stop"] < worst["slow"]


@pytest.mark.parametrize(("name", "clears"), [(name, clears) for name, _, clears in TABLE])
def test_only_passing_causes_go_without_a_neutral_request(name: str, clears: Clears) -> None:
    assert wants_neutral(name) == (clears is not AT_ONCE)


def test_causes_that_settle_or_want_a_reset_and_two_publishers_bar_motion() -> None:
    bars = {rule.name for rule in RULES if bars_motion(rule.name)}
    passing = {rule.name for rule in RULES if rule.clears is Clears.AT_ONCE}
    assert bars == {rule.name for rule in RULES} - passing | {"two_publishers"}
