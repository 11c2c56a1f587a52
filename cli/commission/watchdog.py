"""Verdict on the board's own watchdog: whether wheels that turn stop when commands end. Pure.

The manual documents no watchdog. Two kinds of tries look for one:

========== ============================================= =======================================
try        after the last RUN                            slowing down is seen in
========== ============================================= =======================================
fed        queries go on, as those of the bridge         the velocities
silent     no frame is sent for a time; then one query   the velocities, which the board sends
           of the counters                               unasked; without them in the counters
========== ============================================= =======================================

A board that stops in the silent tries only has a watchdog that queries feed.
"""

from collections.abc import Iterator, Sequence
from statistics import mean

from msgspec import Struct

from cli.commission.report import Row, Verdict, failed, judged
from cli.commission.texts import ENGLISH, Say

RECENT_S = 0.2  # of velocities whose mean counts
SLOWER, SLOW = 0.9, 0.5  # of the speed before: still turning, and slowing down for certain
DROVE_ON = 0.8  # of the way at that speed
SPREAD_S = 0.3  # a try that waits for so much longer than others needed must stop, too

Point = tuple[float, float]  # s since the last command, m/s


class Try(Struct, frozen=True, kw_only=True):
    """One try, from the last motion command on."""

    fed: bool  # whether queries went on
    waited: float  # s without a motion command
    slowed: float | None  # s until the wheels slowed down; None if they drove on
    travelled: float  # m by the counters, until their query after that


def slowed_s(points: Sequence[Point], speed: float) -> float | None:
    """Return when the wheels began to slow down, s; None while they do not.

    It is the first velocity after the last one of about the speed before: noise does not count.
    """
    recent = [v for s, v in points if s > points[-1][0] - RECENT_S]
    if not recent or mean(recent) > SLOW * speed:
        return None
    turning = [n for n, (_, v) in enumerate(points) if v > SLOWER * speed]
    return points[turning[-1] + 1 if turning else 0][0]


def silent_try(points: Sequence[Point], speed: float, waited: float, travelled: float) -> Try:
    """Return a try without queries; ``points`` are the velocities that arrived meanwhile."""
    slowed = None
    if points and points[-1][0] > waited - RECENT_S:
        slowed = slowed_s(points, speed)
    elif travelled < DROVE_ON * speed * waited:
        slowed = travelled / speed
    return Try(fed=False, waited=waited, slowed=slowed, travelled=travelled)


def judge_watchdog(fed: Sequence[Try], silent: Sequence[Try], say: Say = ENGLISH) -> Verdict:
    """Return what the tries show; ``failed`` if they contradict each other."""
    data = [_row(each, say) for each in (*fed, *silent)]
    problems = [
        *_contradictions(fed, "watchdog.fed", say),
        *_contradictions(silent, "watchdog.silence", say),
    ]
    stops, stops_silent = _stops(fed), _stops(silent)
    if stops and not stops_silent and _drove_on_s(silent) > max(stops) + SPREAD_S:
        problems.append(say("watchdog.opposite"))
    if problems:
        return judged([*problems, say("watchdog.unreliable")], "", data, say)
    on_s, silent_s = _drove_on_s(fed), _drove_on_s(silent)
    if stops and stops_silent:
        text = say(
            "watchdog.stops_both", after=_after(stops, say), silence=_after(stops_silent, say)
        )
    elif stops:
        text = say("watchdog.stops", after=_after(stops, say))
    elif stops_silent:
        text = say("watchdog.silent", seconds=on_s, after=_after(stops_silent, say))
    else:
        text = say("watchdog.none", seconds=on_s, silence=silent_s)
    return judged([], text, data, say) if fed and silent else failed(say("watchdog.no_try"))


def _contradictions(tries: Sequence[Try], how: str, say: Say) -> Iterator[str]:
    """Yield what shows that the board does not stop each time."""
    stops = _stops(tries)
    if stops and (drove_on_s := _drove_on_s(tries)) > max(stops) + SPREAD_S:
        yield say(
            "watchdog.contradiction",
            after=_after(stops, say), count=len(stops), all=len(tries), how=say(how),
            seconds=drove_on_s,
        )  # fmt: skip


def _stops(tries: Sequence[Try]) -> list[float]:
    return [each.slowed for each in tries if each.slowed is not None]


def _drove_on_s(tries: Sequence[Try]) -> float:
    """Return the longest time without a stop, s."""
    return max((each.waited for each in tries if each.slowed is None), default=0.0)


def _after(stops: Sequence[float], say: Say) -> str:
    name = "watchdog.after" if len(stops) > 1 else "watchdog.after_one"
    return say(name, mean=mean(stops), least=min(stops), most=max(stops), count=len(stops))


def _row(it: Try, say: Say) -> Row:
    how = say("try.fed") if it.fed else say("try.silent", waited=it.waited)
    if it.slowed is None:
        return how, say("try.drives_on", waited=it.waited, travelled=it.travelled)
    return how, say("try.slows", slowed=it.slowed, travelled=it.travelled)
