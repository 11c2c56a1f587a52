"""The oracle's book on a standstill."""

import pytest

from common.freshness import NS_PER_S
from t2.messages import Command, Motion, Velocity
from verification.search.condition_books import StandstillBook

PERIOD_NS = NS_PER_S // 50


def complaints(speeds: list[float], commanded: list[float]) -> list[str]:
    """Return the complaints about these decisions, 50 a second, without a BRAKE."""
    book, found = StandstillBook(), []
    for number, (speed, command) in enumerate(zip(speeds, commanded, strict=True)):
        now_ns = NS_PER_S + number * PERIOD_NS
        book.on_velocity(Velocity(linear=speed, angular=0.0), now_ns)
        name = Command.RUN if command else Command.STOP
        motion = Motion(command=name, linear=command, angular=0.0, latched=False, source=None)
        found.append(book.complaint(motion, bool(command), now_ns))
    return [each for each in found if each]


@pytest.mark.parametrize(("rolling", "is_wrong"), [(0.3, True), (0.03, False)])
def test_what_rolls_after_the_stop_counts_and_not_what_was_driven_before(
    rolling: float, is_wrong: bool
) -> None:
    driven = [0.5] * 50
    found = complaints([*driven, *[rolling] * 80], [*driven, *[0.0] * 80])
    assert bool(found) is is_wrong
