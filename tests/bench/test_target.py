"""Targets and their table."""

from bench.target import Target, summary, verdict_of

SLOW = Target("T2", "p50: 3 us", "loop: 2 us", 1.5, 1.3)
FAST = Target("T2", "p99: 3 us", "loop: 4 us", 0.75, 1.5)
MUCH = Target("frames", "6", "5", 1.2, 1.0, at_least=True)


def test_a_limit_is_the_highest_or_the_lowest_ratio() -> None:
    assert [each.is_reached for each in (SLOW, FAST, MUCH)] == [False, True, True]
    assert not Target("frames", "4", "5", 0.8, 1.0, at_least=True).is_reached
    assert Target("T2", "at the limit", "", 1.3, 1.3).is_reached


def test_the_summary_has_each_question_once() -> None:
    text = summary([("How soon?", [SLOW, FAST]), ("How much?", [MUCH]), ("Why?", [])])
    assert text.splitlines()[2:] == [
        "| How soon? | T2, p50: 3 us | loop: 2 us | × 1.50 | at most × 1.3 | not reached |",
        "|  | T2, p99: 3 us | loop: 4 us | × 0.75 | at most × 1.5 | reached |",
        "| How much? | frames, 6 | 5 | × 1.20 | at least × 1 | reached |",
    ]


def test_a_row_counts_its_targets() -> None:
    every = [SLOW, FAST, MUCH]
    assert verdict_of("T2", every) == "1 of 2 reached, worst × 1.50 of × 1.3"
    assert verdict_of("frames", every) == "1 of 1 reached"
    assert verdict_of("loop", every) == ""
