"""The oracle's debouncing of the bumper, by port."""

from collections.abc import Iterable

from common.freshness import NS_PER_S
from common.wire.reports import BumperReport
from verification.invariants.bridge_book import BridgeBook

PERIOD_NS = NS_PER_S // 50


def hits(samples: Iterable[tuple[str, bool]]) -> list[int]:
    """Return the polls that begin a hit; a sample names the ports that deliver it."""
    book, found = BridgeBook(1), []
    for number, (ports, pressed) in enumerate(samples):
        for port in map(int, ports):
            if book.on_report(BumperReport(pressed), port, number * PERIOD_NS):
                found.append(number)
    return found


def test_the_first_pressed_sample_is_a_hit() -> None:
    assert hits([("0", True), ("0", True)]) == [0]


def test_three_clear_samples_end_a_hit() -> None:
    assert hits([("0", True), *[("0", False)] * 3, ("0", True)]) == [0, 4]


def test_copies_on_the_other_port_are_no_further_samples() -> None:
    assert hits([("01", True), *[("01", False)] * 2, ("01", True)]) == [0]
    assert hits([("01", True), *[("01", False)] * 3, ("01", True)]) == [0, 4]


def test_a_port_that_has_fallen_silent_does_not_hide_a_hit() -> None:
    samples = [("1", False)] * 20 + [("1", True)] + [("1", False)] * 3 + [("1", True)]
    assert hits([("01", True), *samples]) == [0, 21, 25]
