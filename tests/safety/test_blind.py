"""Which operator may creep toward a sonar that shows nothing."""

from common.freshness import NS_PER_S
from services.safety.blind import SHOWN_NS, Blind

ALL: set[int] = {2, 3}


def test_a_neutral_request_counts_once_the_fault_was_shown_for_a_second() -> None:
    blind = Blind().after({2}, {"teleop"}, 5)
    assert blind.known_to("teleop") == frozenset()
    assert blind.after({2}, {"teleop"}, 5 + SHOWN_NS - 1).known_to("teleop") == frozenset()
    blind = blind.after({2}, {"teleop"}, 5 + SHOWN_NS)
    assert blind.known_to("teleop") == {2}
    assert blind.known_to("web") == blind.known_to(None) == frozenset()
    assert SHOWN_NS == NS_PER_S


def test_it_is_known_until_the_sonar_is_back() -> None:
    known = Blind().after({2}, set(), 0).after({2}, {"web"}, 2 * NS_PER_S)
    assert known.after({2}, set(), 60 * NS_PER_S).known_to("web") == {2}
    again = known.after(set(), set(), 3 * NS_PER_S).after({2}, {"web"}, 4 * NS_PER_S)
    assert again.known_to("web") == frozenset()


def test_another_fault_has_to_be_known_as_well() -> None:
    known = (
        Blind()
        .after({2}, set(), 0)
        .after({2}, {"web"}, 2 * NS_PER_S)
        .after(ALL, {"web"}, 3 * NS_PER_S)
    )
    assert known.known_to("web") == {2}
    assert known.after(ALL, {"web"}, 4 * NS_PER_S).known_to("web") == ALL
