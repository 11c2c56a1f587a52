"""The panels of the screen: pure functions from the view to styled text.

The motion panel is in ``motion_panel.py``.
"""

from datetime import datetime
from textwrap import wrap

from rich.text import Text

from common.messages import Cause, Direction, Release, SafetyState, Verdict
from services.teleop.motion_panel import BAD, DIM, GOOD, WARN, Part
from services.teleop.round_trip import ADVICE
from services.teleop.view import Line, View

KEY = "bold black on cyan"
HELD = "bold black on yellow"
DIRECTIONS: dict[Direction, tuple[str, Direction]] = {  # key and opposite direction
    "forward": ("F", "backward"), "backward": ("B", "forward"),
}  # fmt: skip
BADGES: dict[Verdict, str] = {
    "run": "bold black on green",
    "slow": "bold black on yellow",
    "stop": "bold black on yellow",
    "brake": "bold white on red",
    "inhibited": "bold white on grey35",
}
PREFIX, MIN_TEXT = len("00:00:00 safety  "), 20  # columns of an event line
LEVELS = {"info": "", "warning": WARN, "error": BAD}
KEYS = (
    ("WASD", "drive"), ("␣", "stop"), ("1-5", "gear"), ("T", "turbo"), ("E", "ESTOP"),
    ("R", "reset"), ("FB", "release"), ("Q", "quit"), ("?", "help"),
)  # fmt: skip
HELP = (
    ("W A S D, arrows", "drive and turn on the spot, while held"),
    ("Z C, keypad corners", "arcs: forward left, forward right"),
    ("space", "release all controls and stop"),
    ("E", "emergency stop, latched until R"),
    ("R", "reset the latched causes on the screen"),
    ("F B, held", "move forward or backward off a pressed bumper"),
    ("1 to 5", "gear: 0.2 to 0.8 m/s"),
    ("T", "turbo for the next hold; T, a gear or space cancels it"),
    ("[ ], mouse wheel", "scroll the events to older and newer ones"),
    ("Q, ctrl-c", "stop and quit"),
    ("gamepad", "left shoulder held: sticks drive; right shoulder: turbo"),
    ("?", "close this help; any other key closes it and counts"),
)
SLOW_KEYS = (("␣", "stop"), ("E", "ESTOP"), ("Q", "quit"))  # accepted from a slow terminal


def header(view: View) -> Text:
    """Return the header: robot, connections, gear."""
    bus = ("● bus", GOOD) if view.connected else ("○ no router yet", WARN)
    gear = ("TURBO", BAD) if view.turbo else (f"gear {view.gear}/5", "bold")
    top = (f"{view.top.linear:.2f} m/s {view.top.angular:.2f} rad/s", "")
    parts = [(f"T2 {view.robot}", "bold"), bus, board(view), bumper(view), gear, top]
    return Text("  ", no_wrap=True).join(Text(*part) for part in parts)


def board(view: View) -> Part:
    """Return the state of the link between bridge and board."""
    if view.link is None:
        return ("○ no bridge", WARN)
    if view.link.state == "up":
        return ("● board", GOOD)
    return ("○ board lost" if view.link.state == "lost" else "○ board never seen", BAD)


def bumper(view: View) -> Part:
    """Return the state of the bumper."""
    if view.bumper is None:
        return ("○ bumper", WARN)
    return ("● bumper PRESSED", BAD) if view.bumper.pressed else ("● bumper", GOOD)


def safety(view: View, rows: int) -> Text:
    """Return verdict, text and causes, latched ones first; causes by name if rows are short."""
    if view.alarm:
        alarm = Text(view.alarm, style=BAD)
        return Text("\n").join([alarm, _safety(view, rows - 1)])
    return _safety(view, rows)


def _safety(view: View, rows: int) -> Text:
    state = view.safety
    if state is None and not view.connected:
        return Text.assemble((" NO ROUTER ", BADGES["inhibited"]), "  no connection to the router")
    if state is None:
        return Text.assemble(
            (" NO SAFETY ", BADGES["inhibited"]),
            "  no state of safety received; check it with `t2 doctor`",
        )
    text = Text.assemble((f" {state.verdict.upper()} ", BADGES[state.verdict]), f"  {state.text}")
    if (lines := release(view)) is not None:
        return Text("\n").join([text, *lines, *_causes(state, rows - 1 - len(lines))])
    return Text("\n").join([text, *_causes(state, rows - 1)])


def release(view: View) -> tuple[Text, Text] | None:
    """Return how to move off a pressed bumper, in two rows; None if none is pressed."""
    known = view.safety.release if view.safety else None
    if known is None or (view.bumper is not None and not view.bumper.pressed):
        return None
    keys = Text("   ").join(_key(known, direction, view.release) for direction in DIRECTIONS)
    return _believed(known), keys.append(f"   {known.left:.2f} m left until reset", style="bold")


def _believed(known: Release) -> Text:
    if known.believed_free is None:
        return Text.assemble("RELEASE  free direction ", ("unknown: look at the vehicle", BAD))
    came = DIRECTIONS[known.believed_free][1]
    age = "" if known.age is None else f", {_age(known.age)} ago"
    return Text.assemble(
        "RELEASE  believed free: ", (known.believed_free.upper(), GOOD),
        f" (moved {came}{age}; net {known.travelled:+.2f} m)",
    )  # fmt: skip


def _key(known: Release, direction: Direction, held: Direction | None) -> Text:
    key = (f" {DIRECTIONS[direction][0]} ", HELD if held == direction else KEY)
    if direction in known.forbidden:
        return Text.assemble(key, f" {direction} ", ("FORBIDDEN", BAD))
    return Text.assemble(key, f" {direction}", (", held" if held == direction else "", WARN))


def _causes(state: SafetyState, rows: int) -> list[Text]:
    """Return one row per cause, or all names in one row if there are too few rows."""
    causes = [cause for cause in state.causes if cause.name != "no_request"]
    causes.sort(key=lambda cause: cause.name not in state.latched)
    if len(causes) <= rows:
        return [_cause(cause, cause.text, state) for cause in causes]
    return [Text("  ").join(_cause(cause, cause.name, state) for cause in causes)]


def _cause(cause: Cause, text: str, state: SafetyState) -> Text:
    latched = cause.name in state.latched
    tag = ("LATCHED ", BAD) if latched else (f"{cause.action} ", WARN)
    return Text.assemble(tag, text, (f" {_age(cause.age)}{', R resets' if latched else ''}", DIM))


def help_text() -> Text:
    """Return the keys and what they do."""
    return Text("\n", no_wrap=True).join(
        Text.assemble((f"{key:<21}", "bold cyan"), action) for key, action in HELP
    )


def events(view: View, rows: int, width: int = 200, skipped: int = 0) -> Text:
    """Return event lines, the newest last, wrapped to the width, without the newest ``skipped``."""
    shown: list[Text] = []
    for line in reversed(view.lines[: len(view.lines) - skipped]):
        room = rows - len(shown)
        if room <= 0:
            break
        shown = [*_wrapped(line, max(MIN_TEXT, width - PREFIX))[:room], *shown]
    return Text("\n", no_wrap=True).join(shown)


def _wrapped(line: Line, width: int) -> list[Text]:
    first, *rest = wrap(line.text, width) or [""]
    style = LEVELS[line.level]
    head = Text.assemble(
        (f"{datetime.fromtimestamp(line.t_ns / 1e9):%H:%M:%S} ", DIM),
        (f"{line.service:<7} ", "cyan"),
        (first, style),
    )
    return [head, *(Text(" " * PREFIX + more, style=style) for more in rest)]


def hints(view: View, hold_first_s: float, hold_s: float) -> Text:
    """Return the keys, and the limit of key repeats or why keys are refused."""
    keys = [hint for hint in KEYS if hint in SLOW_KEYS or not view.keys_refused]
    row = Text(" ", no_wrap=True).join(Text.assemble((key, KEY), f" {what}") for key, what in keys)
    if view.keys_refused:
        return row.append(f"  KEYS OFF: {view.keys_refused}\n{ADVICE.capitalize()}.", style=BAD)
    limit = (
        f"\nNo key-up in terminals: a tap drives {hold_first_s:g} s, "
        f"a hold {hold_s:g} s past its last repeat"
    )
    return row.append(limit, style=DIM)


def _age(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"
