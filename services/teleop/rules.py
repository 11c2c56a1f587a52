"""The rules of ``core.hold`` that need the bus, the terminal or the gamepad, each reported once.

They let go of the controls, so that nothing old moves the vehicle.
"""

from common.freshness import NS_PER_S
from services.teleop.core.controls import Controls
from services.teleop.event_log import OwnEvents
from t2.client import Contest
from t2.messages import EventName, Field, Phrase, Phrases, SafetyState

UNHEARD_S = 0.5  # without a fresh state of safety; with its own 0.5 s this is 1 s


class Rules:
    """Enforces the rules in each tick."""

    def __init__(self, controls: Controls, source: str, report: OwnEvents) -> None:
        """``source`` is the name under which this program drives."""
        self.overruled_by: str | None = None  # while that source drives
        self._controls, self._report_event = controls, report
        self._contest = Contest(source)
        self._heard_ns: int | None = None  # the last tick with a fresh state of safety
        self._reported: set[str] = set()  # rules that are broken, and in the event log

    @property
    def other_driver(self) -> str | None:
        """The source that drives instead of this one."""
        return self._contest.other

    def enforce(self, state: SafetyState | None, now_ns: int, *, requests: bool) -> None:
        """Enforce all; ``requests``: whether this program requests motion."""
        # A program that was suspended has a fresh state at once, and controls from before.
        unheard_s = (now_ns - (self._heard_ns or now_ns)) / NS_PER_S
        self._enforce("unheard", unheard_s > UNHEARD_S, now_ns, seconds=1.0)
        if state is not None:
            self._heard_ns = now_ns
        contest = self._contest
        contest.tick(state, requests=requests)
        if contest.is_lost:
            self.overruled_by = contest.other
        elif contest.other is None and not self._controls.is_muted(now_ns):
            self.overruled_by = None
        self._enforce("overruled", contest.is_lost, now_ns, other=contest.other)
        if not (reason := self._controls.terminal.refusal(now_ns)):
            self._reported.discard("terminal_slow")
        elif self._controls.holds_keystrokes(now_ns):
            self._controls.enforce("terminal_slow", now_ns)
            self.report_slow(reason)

    def report_slow(self, reason: Phrases) -> None:
        """Report that keystrokes are refused, because the terminal is too slow."""
        advice = Phrase("terminal.ignored"), *reason, Phrase("terminal.advice")
        self._report("terminal_slow", *advice)

    def report_gamepad(self, seconds: float, axes: dict[int, float]) -> None:
        """Report a gamepad whose reading has not changed for so long, and axes that are ignored.

        The axes are reported once for each press of the deadman.
        """
        if self._controls.is_gamepad_silent:
            self._report("gamepad_silent", seconds=seconds)
        else:
            self._reported.discard("gamepad_silent")
        if axes and "off_centre" not in self._reported:
            for axis, position in axes.items():
                about: dict[str, Field] = {"axis": axis, "position": position}
                self._report_event.note("warning", Phrase("gamepad.off_centre", about))
        (self._reported.add if axes else self._reported.discard)("off_centre")

    def _enforce(self, rule: EventName, is_broken: bool, now_ns: int, **about: Field) -> None:
        if is_broken:
            self._controls.enforce(rule, now_ns)
            self._report(rule, **about)
        else:
            self._reported.discard(rule)

    def _report(self, rule: EventName, *phrases: Phrase, **about: Field) -> None:
        """Report a rule once, until it holds again."""
        if rule not in self._reported:
            self._reported.add(rule)
            self._report_event(rule, "warning", *phrases, **about)
