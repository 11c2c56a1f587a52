"""How long to wait before a restart."""

import pytest

from common.child_process import BACKOFF_S, CALM_S, Backoff


def test_the_first_restart_is_at_once_and_the_next_ones_ever_later() -> None:
    backoff = Backoff()
    waits = [backoff.after(0.0) for _ in range(8)]
    assert waits == [0.0, 0.5, 1.0, 2.0, 5.0, 5.0, 5.0, 5.0]


@pytest.mark.parametrize(("lived_s", "next_s"), [(CALM_S, BACKOFF_S[3]), (CALM_S + 0.1, 0.0)])
def test_a_calm_life_begins_with_the_first_again(lived_s: float, next_s: float) -> None:
    backoff = Backoff()
    for _ in range(3):
        backoff.after(0.0)
    assert backoff.after(lived_s) == next_s
    assert backoff.after(0.0) > next_s
