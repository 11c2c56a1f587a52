"""Each way to clear, at its boundary."""

import pytest

from services.safety.causes import RULES, severity, wants_neutral
from services.safety.latches import (
    GOOD_SAMPLES,
    Held,
    Latches,
    Observation,
    latched,
    observe,
    ordered,
    reset,
    still_there,
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
        assert still_there(held) == ("contact",)
        held = see(held, "contact", False, seq, seq)
        held = see(held, "contact", False, seq, seq)  # the same sample again
    assert still_there(held) == ()
    assert latched(held) == ("contact",)
    held = see(held, "contact", True, 99, seq=9)
    assert still_there(held) == ("contact",)
    assert held["contact"].since_ns == 0


def test_the_sample_that_showed_a_cause_is_no_good_one() -> None:
    held = see({}, "contact", True, 7, seq=5)
    assert held["contact"] == Held(7, 7, 0, (1, 5), "The bumper was hit.")
    assert see(held, "contact", False, 8, seq=5)["contact"].good == 0
    assert see(held, "contact", False, 8, seq=6)["contact"].good == 1


def test_a_reset_clears_what_is_latched_only() -> None:
    held = see(see({}, "estop", True, 0, seq=1), "link", True, 0)
    for seq in range(2, 2 + GOOD_SAMPLES):
        held = see(held, "estop", False, seq, seq)
    assert set(reset(held)) == {"link"}


def test_a_reset_leaves_what_is_not_gone() -> None:
    held = see(see({}, "estop", True, 0, seq=1), "contact", True, 0, seq=1)
    held = see(held, "driver_left", True, 0, seq=1)
    for seq in range(2, 2 + GOOD_SAMPLES):
        held = see(held, "estop", False, seq, seq)
    assert still_there(held) == ("contact", "driver_left")
    assert set(reset(held)) == {"contact", "driver_left"}


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
