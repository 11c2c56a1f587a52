"""The view in words: pure functions from what is known to styled text, one for each panel.

The table of the motion panel is in ``table.py``.
"""

from datetime import datetime

from rich.text import Text

from common.messages import Cause, SafetyState, Verdict
from services.teleop.table import BAD, DIM, GOOD, WARN, Part
from services.teleop.view import View

KEY = "bold black on cyan"
BADGES: dict[Verdict, str] = {
    "run": "bold black on green",
    "slow": "bold black on yellow",
    "stop": "bold black on yellow",
    "brake": "bold white on red",
    "inhibited": "bold white on grey35",
}
LEVELS = {"info": "", "warning": WARN, "error": BAD}
KEYS = (
    ("WASD", "drive"), ("ZC", "arc"), ("␣", "stop"), ("1-5", "gear"), ("T", "turbo"),
    ("E", "ESTOP"), ("R", "reset"), ("F", "creep"), ("Q", "quit"),
)  # fmt: skip


def header(view: View) -> Text:
    """Which robot, the ways to it, the gear."""
    bus = ("● bus", GOOD) if view.connected else ("○ no router yet", WARN)
    gear = ("TURBO", BAD) if view.turbo else (f"gear {view.gear}/5", "bold")
    top = (f"{view.top.linear:.2f} m/s {view.top.angular:.2f} rad/s", "")
    parts = [(f"T2 {view.robot}", "bold"), bus, board(view), bumper(view), gear, top]
    return Text("  ", no_wrap=True).join(Text(*part) for part in parts)


def board(view: View) -> Part:
    """The way from the bridge to the vehicle's board."""
    if view.link is None:
        return ("○ no bridge", WARN)
    if view.link.state == "up":
        return ("● board", GOOD)
    return ("○ board lost" if view.link.state == "lost" else "○ board never seen", BAD)


def bumper(view: View) -> Part:
    """The bumper strip."""
    if view.bumper is None:
        return ("○ bumper", WARN)
    return ("● bumper PRESSED", BAD) if view.bumper.pressed else ("● bumper", GOOD)


def safety(view: View, rows: int) -> Text:
    """The verdict, its sentence, and the causes, the latched ones first; by name if cramped."""
    state = view.safety
    if state is None:
        return Text.assemble((" NO SAFETY ", BADGES["inhibited"]), "  its service is not heard")
    text = Text.assemble((f" {state.verdict.upper()} ", BADGES[state.verdict]), f"  {state.text}")
    causes = [cause for cause in state.causes if cause.name != "no_request"]
    causes.sort(key=lambda cause: cause.name not in state.latched)
    if len(causes) < rows:
        parts = [_cause(cause, cause.text, state) for cause in causes]
        return Text("\n").join([text, *parts])
    names = Text("  ").join(_cause(cause, cause.name, state) for cause in causes)
    return Text("\n").join([text, names])


def _cause(cause: Cause, words: str, state: SafetyState) -> Text:
    latched = cause.name in state.latched
    tag = ("LATCHED ", BAD) if latched else (f"{cause.action} ", WARN)
    return Text.assemble(tag, words, (f" {_age(cause.age)}{', R resets' if latched else ''}", DIM))


def events(view: View, rows: int) -> Text:
    """The newest lines, the newest last."""
    text = Text("\n", no_wrap=True)
    return text.join(
        Text.assemble(
            (f"{datetime.fromtimestamp(line.t_ns / 1e9):%H:%M:%S} ", DIM),
            (f"{line.service:<7} ", "cyan"),
            (line.text, LEVELS[line.level]),
        )
        for line in view.lines[max(0, len(view.lines) - rows) :]
    )


def hints(hold_first_s: float, hold_s: float) -> Text:
    """The keys, and what a terminal cannot tell."""
    row = Text(" ", no_wrap=True).join(Text.assemble((key, KEY), f" {what}") for key, what in KEYS)
    limit = (
        f"\nNo key-up in terminals: a tap drives {hold_first_s:g} s, "
        f"a hold {hold_s:g} s past the last repeat"
    )
    return row.append(limit, style=DIM)


def _age(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"
