"""Each way to clear, at its boundary."""

import pytest

from common.freshness import NS_PER_S
from services.safety.core.causes import (
    FAILURES,
    GOOD_SAMPLES,
    RULES,
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


def see(held: Latches, name: str, present: bool, now_ns: int, seq: int = 0) -> dict[str, Held]:
    return observe(held, [Observation(name, present, (1, seq))], now_ns, SETTLE_NS)


def test_what_is_not_observed_stays() -> None:
    held = see({}, "neutral", True, 0)
    assert set(see(held, "link", True, 1)) == {"neutral", "link"}


def test_a_passing_cause_goes_with_its_observation() -> None:
    held = see({}, "neutral", True, 0)
    assert see(held, "neutral", False, 1) == {}
    assert see({}, "neutral", False, 1) == {}


@pytest.mark.parametrize(("now_ns", "stays"), [(600, True), (599, True), (601, False)])
def test_an_inhibiting_cause_settles(now_ns: int, stays: bool) -> None:
    held = see(see({}, "link", True, 0), "link", True, 101)
    assert ("link" in see(held, "link", False, now_ns)) == stays
    assert held["link"].since_ns == 0


def test_without_a_time_to_settle_none_is_needed() -> None:
    held = see({}, "link", True, 0)
    assert observe(held, [Observation("link", False, (1, 1))], 0) == {}


def test_a_latched_cause_counts_good_samples_and_waits_for_a_reset() -> None:
    assert GOOD_SAMPLES == 3
    held = see({}, "contact", True, 0, seq=1)
    for seq in range(2, 2 + GOOD_SAMPLES):
        assert still_present(held) == ("contact",)
        held = see(held, "contact", False, seq, seq)
        held = see(held, "contact", False, seq, seq)  # the same sample again
    assert still_present(held) == ()
    assert latched(held) == ("contact",)
    held = see(held, "contact", True, 99, seq=9)
    assert still_present(held) == ("contact",)


def test_the_sample_that_showed_a_cause_is_no_good_one() -> None:
    held = see({}, "contact", True, 7, seq=5)
    assert held["contact"] == Held(7, 7, 0, (1, 5), "The bumper was hit.", 0)
    assert see(held, "contact", False, 8, seq=5)["contact"].good == 0
    assert see(held, "contact", False, 8, seq=6)["contact"].good == 1


def test_a_reset_clears_what_is_latched_only() -> None:
    held = see(see({}, "estop", True, 0, seq=1), "link", True, 0)
    for seq in range(2, 2 + GOOD_SAMPLES):
        held = see(held, "estop", False, seq, seq)
    assert set(reset(held, [held["estop"].id])) == {"link"}
    assert set(reset(held, [held["link"].id])) == {"link", "estop"}


def test_a_reset_leaves_what_is_not_gone() -> None:
    held = see(see({}, "estop", True, 0, seq=1), "contact", True, 0, seq=1)
    held = see(held, "driver_left", True, 0, seq=1)
    for seq in range(2, 2 + GOOD_SAMPLES):
        held = see(held, "estop", False, seq, seq)
    assert still_present(held) == ("contact", "driver_left")
    assert set(reset(held, [one.id for one in held.values()])) == {"contact", "driver_left"}


def test_a_reset_clears_the_named_occurrences_only() -> None:
    held = see(see({}, "estop", True, 0, seq=1), "runaway", True, 0, seq=1)
    for seq in range(2, 2 + GOOD_SAMPLES):
        held = see(see(held, "estop", False, seq, seq), "runaway", False, seq, seq)
    runaway = held["runaway"].id
    assert named(held, [runaway]) == ("runaway",)
    assert named(held, [held["estop"].id, runaway]) == ("estop", "runaway")
    assert set(reset(held, [runaway])) == {"estop"}
    assert reset(held, []) == held


def test_a_cause_that_began_in_a_decision_differs_from_older_ones() -> None:
    held = observe({}, [Observation("estop", True, (0, 0))], 0, decision=8)
    held = observe(held, [Observation("runaway", True, (0, 1))], 1, decision=9)
    held = observe(held, [Observation("link", True, (0, 1))], 1, decision=9)
    assert begun(held, 8) == ("estop",)
    assert begun(held, 9) == ("runaway",)
    assert begun(held, 10) == ()


def occurrence(goods: int) -> tuple[Held, Held]:
    """Return a cause, and the same when it comes back after so many good samples."""
    held = observe({}, [Observation("contact", True, (1, 1))], 5, decision=100)
    before = held["contact"]
    for seq in range(2, 2 + goods):
        held = observe(held, [Observation("contact", False, (1, seq))], seq, decision=100 + seq)
    held = observe(held, [Observation("contact", True, (1, 50))], 50, decision=150)
    return before, held["contact"]


@pytest.mark.parametrize("goods", [0, 1, 2])
def test_a_short_gap_is_the_same_occurrence(goods: int) -> None:
    before, after = occurrence(goods)
    assert (after.id, after.since_ns, after.bad_ns) == (before.id, 5, 50)


@pytest.mark.parametrize("goods", [3, 4])
def test_a_cause_that_comes_back_has_a_new_identity_and_age(goods: int) -> None:
    before, after = occurrence(goods)
    assert after.id == before.id + 50 * len(RULES)
    assert after.since_ns == 50


def test_identities_differ_by_cause_and_decision() -> None:
    ids = {
        observe({}, [Observation(rule.name, True, (0, 0))], 0, decision=decision)[rule.name].id
        for rule in RULES
        for decision in (7, 8)
    }
    assert len(ids) == 2 * len(RULES)
    assert min(ids) == 7 * len(RULES)


def test_an_observation_may_have_words_of_its_own() -> None:
    held = observe({}, [Observation("link", True, (0, 0), "Gone.")], 0, 0)
    assert held["link"].text == "Gone."


def test_the_worst_comes_first() -> None:
    names = [rule.name for rule in RULES]
    assert ordered(reversed(names)) == tuple(sorted(names, key=severity))
    assert ordered(["sonar", "link", "contact"]) == ("contact", "link", "sonar")


def test_only_passing_causes_go_without_a_neutral_request() -> None:
    assert wants_neutral("contact")
    assert wants_neutral("link")
    assert not wants_neutral("no_request")


def test_credit_drains_faster_than_it_refills() -> None:
    budget = FaultBudget()
    for n in range(int(FAILURES)):
        assert not budget.is_spent
        budget = budget.updated((n + 1) * NS_PER_S, failed=True, good=False)
    assert budget.is_spent
    assert budget.updated(99 * NS_PER_S, failed=False, good=False).is_spent
    assert budget.updated(6 * NS_PER_S, failed=False, good=True).remaining == pytest.approx(0.1)
    assert FaultBudget().updated(99 * NS_PER_S, failed=False, good=True).remaining == FAILURES
