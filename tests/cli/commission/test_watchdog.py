"""Verdicts on the board's own watchdog, from tries."""

import pytest

from cli.commission.watchdog import Try, judge_watchdog, silent_try, slowed_s

PERIOD_S = 0.02
WAITS = (1.0, 2.0, 4.0)


def velocities(*speeds: float) -> list[tuple[float, float]]:
    return [(PERIOD_S * number, speed) for number, speed in enumerate(speeds, 1)]


def fed(*slowed: float | None) -> list[Try]:
    return [Try(fed=True, waited=5.0, slowed=each, travelled=0.1) for each in slowed]


def silent(*slowed: float | None) -> list[Try]:
    """Return a try for each wait."""
    return [
        Try(fed=False, waited=wait, slowed=each, travelled=0.1)
        for wait, each in zip(WAITS, slowed, strict=True)
    ]


def test_slowing_down_begins_after_the_last_velocity_of_the_speed_before() -> None:
    noisy = [0.1, 0.085, 0.102, 0.08, 0.1]  # one below 0.09 is noise if the speed comes back
    assert slowed_s(velocities(*noisy, 0.06, 0.02, *[0.0] * 10), 0.1) == pytest.approx(0.12)
    assert slowed_s(velocities(*noisy * 4), 0.1) is None
    assert slowed_s(velocities(*[0.07] * 30), 0.1) is None  # slower, but turning
    assert slowed_s(velocities(*[0.0] * 30), 0.1) == pytest.approx(0.02)


def test_a_silent_board_is_judged_by_its_counters() -> None:
    """A board may send its velocity only to a PC that speaks."""
    early = velocities(0.1, 0.1)
    assert silent_try(early, 0.1, 2.0, travelled=0.199).slowed is None
    assert silent_try([], 0.1, 2.0, travelled=0.05).slowed == pytest.approx(0.5)
    stopped = velocities(*[0.1] * 25, *[0.0] * 75)
    assert silent_try(stopped, 0.1, 2.0, travelled=0.06).slowed == pytest.approx(0.52)


@pytest.mark.parametrize(
    ("tries", "waits", "outcome", "texts"),
    [
        (
            (0.5, 0.54, 0.52),
            (0.52, 0.52, 0.52),
            "passed",
            ["The board stops by itself 0.52 s (0.50 to 0.54 in 3 tries) after the last motion"],
        ),
        (
            (None, None, None),
            (None, None, None),
            "passed",
            [
                "drives on for at least 5 s without a motion command, and for 4 s without any "
                "frame: it has no watchdog",
                "only the stop switch",
            ],
        ),
        (
            (None, None, None),
            (None, 1.5, 1.5),
            "passed",
            ["queries go on: they feed its watchdog. In silence it stops by itself 1.50 s"],
        ),
        ((4.5, 4.5, 4.5), (None, None, None), "passed", ["4.50 s (4.50 to 4.50 in 3 tries)"]),
        (
            (0.5, None, 0.5),
            (0.5, 0.5, 0.5),
            "failed",
            [
                "in 2 of 3 tries with queries, and drove on for 5 s",
                "no watchdog that can be relied",
            ],
        ),
        ((0.5, 0.5, 0.5), (None, None, None), "failed", ["but drove on in silence"]),
        ((None, None, None), (0.5, None, 0.5), "failed", ["in 2 of 3 tries in silence"]),
    ],
)
def test_verdicts(
    tries: tuple[float | None, ...],
    waits: tuple[float | None, ...],
    outcome: str,
    texts: list[str],
) -> None:
    found = judge_watchdog(fed(*tries), silent(*waits))
    assert found.outcome == outcome
    for text in texts:
        assert text in found.text
    assert len(found.data) == 6


def test_nothing_is_claimed_without_tries() -> None:
    assert judge_watchdog([], []).outcome == "failed"
