"""Causes: the table by hand, and each way to clear, at its boundary."""

import pytest

from common.freshness import NS_PER_S
from common.messages import Action
from services.safety.core.causes import (
    BARRING,
    FAILURES,
    GOOD_SAMPLES,
    RULES,
    Clears,
    FaultBudget,
    Held,
    Latches,
    Observation,
    begun,
    latched,
    named,
    observe,
    ordered,
    reset,
    severity,
    still_present,
    wants_neutral,
)

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


def test_order_and_groups_of_the_table() -> None:
    names = [name for name, _, _ in TABLE]
    assert sorted(names, key=severity) == names
    assert ordered(reversed(names)) == tuple(names)
    worst = {action: severity(name)[0] for name, action, _ in TABLE}
    assert worst["brake"] < worst["stop"] < worst["slow"]
    lasting = {name for name, _, clears in TABLE if clears is not AT_ONCE}
    assert {name for name in names if wants_neutral(name)} == lasting
    assert lasting | {"two_publishers"} == BARRING
    assert not any(name in BARRING for name, action, _ in TABLE if action == "slow")


# --- held causes ----------------------------------------------------------------------------


def see(held: Latches, name: str, present: bool, now_ns: int, seq: int = 0) -> dict[str, Held]:
    return observe(held, [Observation(name, present, (1, seq))], now_ns, SETTLE_NS)


def gone(held: Latches, *names: str) -> Latches:
    """Return the causes after so many good samples of these that a reset may clear them."""
    for seq in range(2, 2 + GOOD_SAMPLES):
        for name in names:
            held = see(held, name, False, seq, seq)
    return held


@pytest.mark.parametrize(
    ("name", "now_ns", "stays"),
    [
        ("neutral", 101, False), ("limit_stop", 101, False),  # at once
        ("link", 600, True), ("link", 601, False), ("link", 602, False),  # settled
        ("estop", 9999, True),  # by a reset
    ],
)  # fmt: skip
def test_each_way_to_clear(name: str, now_ns: int, stays: bool) -> None:
    held = see(see({}, name, True, 0), name, True, 101)
    assert held[name].since_ns == 0
    assert set(see(held, "bumper", True, now_ns)) == {name, "bumper"}  # it was not observed
    assert (name in see(held, name, False, now_ns)) is stays
    assert see({}, name, False, now_ns) == {}


def test_without_a_time_to_settle_none_is_needed() -> None:
    assert observe(see({}, "link", True, 0), [Observation("link", False, (1, 1))], 0) == {}


def test_a_latched_cause_counts_good_samples_and_waits_for_a_reset() -> None:
    assert GOOD_SAMPLES == 3
    held = see({}, "contact", True, 7, seq=5)
    assert held["contact"] == Held(7, 7, 0, (1, 5), "The bumper was hit.", 0)
    held = see(held, "contact", False, 8, seq=5)  # the sample that showed it is no good one
    for seq in range(6, 6 + GOOD_SAMPLES):
        assert still_present(held) == ("contact",)
        held = see(held, "contact", False, seq, seq)
        held = see(held, "contact", False, seq, seq)  # the same sample again
    assert (still_present(held), latched(held)) == ((), ("contact",))
    assert still_present(see(held, "contact", True, 99, seq=99)) == ("contact",)


def test_a_reset_clears_the_named_latches_that_are_gone() -> None:
    held: Latches = {}
    for name in ("estop", "runaway", "contact", "link"):
        held = see(held, name, True, 0, seq=1)
    held = gone(held, "estop", "runaway")
    estop, runaway, contact, link = (one.id for one in held.values())
    for ids, cleared in (
        ((), set()),
        ((estop,), {"estop"}),
        ((estop, runaway), {"estop", "runaway"}),
        ((contact, link), set()),
        ((estop, contact), {"estop"}),
    ):
        assert named(held, ids) == ordered(n for n in latched(held) if held[n].id in ids)
        assert held.keys() - reset(held, ids).keys() == cleared
    assert still_present(held) == ("contact",)


def test_begun_names_the_latches_of_one_decision() -> None:
    held = observe({}, [Observation("estop", True, (0, 0))], 0, decision=8)
    held = observe(held, [Observation("runaway", True, (0, 1), "Gone.")], 1, decision=9)
    held = observe(held, [Observation("link", True, (0, 1))], 1, decision=9)
    assert [begun(held, decision) for decision in (8, 9, 10)] == [("estop",), ("runaway",), ()]
    assert held["runaway"].text == "Gone."


@pytest.mark.parametrize(("goods", "same"), [(0, True), (2, True), (3, False), (4, False)])
def test_a_cause_that_comes_back_after_three_good_samples_is_new(goods: int, same: bool) -> None:
    held = observe({}, [Observation("contact", True, (1, 1))], 5, decision=100)
    before = held["contact"]
    for seq in range(2, 2 + goods):
        held = observe(held, [Observation("contact", False, (1, seq))], seq, decision=100 + seq)
    after = observe(held, [Observation("contact", True, (1, 50))], 50, decision=150)["contact"]
    expected = (before.id, 5) if same else (before.id + 50 * len(RULES), 50)
    assert (after.id, after.since_ns, after.bad_ns) == (*expected, 50)


def test_identities_differ_by_cause_and_decision() -> None:
    ids = {
        observe({}, [Observation(rule.name, True, (0, 0))], 0, decision=decision)[rule.name].id
        for rule in RULES
        for decision in (7, 8)
    }
    assert len(ids) == 2 * len(RULES)
    assert min(ids) == 7 * len(RULES)


def test_the_fault_budget_drains_faster_than_it_refills() -> None:
    budget = FaultBudget()
    for n in range(int(FAILURES)):
        assert not budget.is_spent
        budget = budget.updated((n + 1) * NS_PER_S, failed=True, good=False)
    assert budget.is_spent
    assert budget.updated(99 * NS_PER_S, failed=False, good=False).is_spent
    assert budget.updated(6 * NS_PER_S, failed=False, good=True).remaining == pytest.approx(0.1)
    assert FaultBudget().updated(99 * NS_PER_S, failed=False, good=True).remaining == FAILURES
