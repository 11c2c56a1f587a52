"""Causes: the table by hand, and each way to clear, at its boundary."""

from typing import Any

import pytest

from common.freshness import NS_PER_S
from services.safety.core.causes import (
    BARRING,
    FAILURES,
    RULES,
    Clears,
    FaultBudget,
    Latches,
    Observation,
    begun,
    observe,
    ordered,
)
from t2.messages import Action

SETTLE_NS = 500
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
    ("two_publishers", "stop", NEUTRAL),
    ("neutral", "stop", AT_ONCE),
    ("blocked", "stop", AT_ONCE),
    ("no_request", "stop", AT_ONCE),
    ("release", "slow", AT_ONCE),
    ("limit", "slow", AT_ONCE),
    ("obstacle", "slow", AT_ONCE),
    ("sonar", "slow", AT_ONCE),
]


def test_the_table() -> None:
    assert [(rule.name, rule.action, rule.clears) for rule in RULES] == TABLE


def test_order_and_groups_of_the_table() -> None:
    names: Any = [name for name, _, _ in TABLE]
    assert ordered(reversed(names)) == tuple(names)
    actions = [action for _, action, _ in TABLE]
    assert actions == sorted(actions, key=["brake", "stop", "slow"].index)
    lasting = {name for name, _, clears in TABLE if clears is not AT_ONCE}
    assert lasting == BARRING


# --- held causes ----------------------------------------------------------------------------


def see(
    held: Latches,
    name: Any,
    present: bool,
    now_ns: int,
    *,
    seq: int | None = None,
    decision: int = 0,
) -> Latches:
    """Observe one cause, by a sample with this number, or without one."""
    seen = [Observation(name)] if present else []
    samples = {} if seq is None else {name: (1, seq)}
    return observe(
        held, seen, {name}, now_ns, samples=samples, settle_ns=SETTLE_NS, decision=decision
    )


@pytest.mark.parametrize(
    ("name", "now_ns", "stays"),
    [
        ("neutral", 101, False), ("limit_stop", 101, False),  # at once
        ("link", 600, True), ("link", 601, False), ("link", 602, False),  # settled
        ("estop", 9999, True),  # by a reset
    ],
)  # fmt: skip
def test_each_way_to_clear(name: Any, now_ns: int, stays: bool) -> None:
    held = see(see({}, name, True, 0), name, True, 101)
    assert held[name].since_ns == 0
    assert set(see(held, "bumper", True, now_ns)) == {name, "bumper"}  # it was not observed
    assert (name in see(held, name, False, now_ns)) is stays
    assert see({}, name, False, now_ns) == {}


@pytest.mark.parametrize(("goods", "same"), [(0, True), (2, True), (3, False), (4, False)])
def test_a_cause_that_comes_back_after_three_good_samples_is_new(goods: int, same: bool) -> None:
    held = see({}, "contact", True, 5, seq=1, decision=100)
    before = held["contact"]
    for seq in range(2, 2 + goods):
        for now_ns in (10 * seq, 10 * seq + 1):  # one good sample counts once
            held = see(held, "contact", False, now_ns, seq=seq, decision=100 + seq)
    after = see(held, "contact", True, 50, seq=50, decision=150)["contact"]
    expected = (before.id, 5) if same else (before.id + 50 * len(RULES), 50)
    assert (after.id, after.since_ns, after.bad_ns) == (*expected, 50)


def test_the_fault_budget_drains_faster_than_it_refills() -> None:
    budget = FaultBudget()
    for n in range(int(FAILURES)):
        assert not budget.is_spent
        budget = budget.updated((n + 1) * NS_PER_S, failed=True, good=False)
    assert budget.is_spent
    assert budget.updated(99 * NS_PER_S, failed=False, good=False).is_spent
    assert budget.updated(6 * NS_PER_S, failed=False, good=True).remaining == pytest.approx(0.1)
    assert FaultBudget().updated(99 * NS_PER_S, failed=False, good=True).remaining == FAILURES


def test_a_cause_that_began_in_this_decision() -> None:
    held = see({}, "estop", True, 5)
    assert held["estop"].id == [rule.name for rule in RULES].index("estop")
    assert see({}, "link", True, 5, decision=2).keys() == {"link"}
    both = see(held, "driver_left", True, 6, decision=2)
    assert (begun(both, 0), begun(both, 1), begun(both, 2)) == (("estop",), (), ("driver_left",))


def test_without_a_time_to_settle_a_cause_clears_at_once() -> None:
    held = see({}, "link", True, 5)
    assert observe(held, [], {"link"}, 5, decision=0) == {}
    assert observe(held, [], {"bumper"}, 5, decision=0) == held  # nobody looked


def test_the_sample_that_shows_a_cause_is_no_good_one() -> None:
    held = see({}, "contact", True, 5, seq=1)
    assert see(held, "contact", False, 6, seq=1)["contact"].good == 0


def test_without_a_sample_each_decision_counts() -> None:
    held = see({}, "estop", True, 5)
    assert see(held, "estop", False, 5)["estop"].good == 0
    assert [(held := see(held, "estop", False, 6 + n))["estop"].good for n in (0, 0, 1)] == [
        1,
        1,
        2,
    ]
