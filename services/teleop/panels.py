"""The panels of the screen: functions from the view to styled text."""

import math
from datetime import datetime
from textwrap import wrap

from rich.text import Text

from common.root_cause import TEXTS, RootCause, root_cause
from services.teleop.core.hold import HOLD_S
from services.teleop.core.round_trip import ADVICE
from services.teleop.view import Line, View
from t2.messages import (
    SONAR_NAMES,
    Cause,
    Direction,
    Driver,
    Release,
    SafetyState,
    Ultrasonic,
    Verdict,
)

Part = tuple[str, str]  # text and its style

GOOD, WARN, BAD, DIM = "green", "bold yellow", "bold red", "grey58"
NO_DATA = ("no data", DIM)
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
SLOW_KEYS = (("␣", "stop"), ("E", "ESTOP"), ("Q", "quit"))  # accepted from a slow terminal
KEYS = (
    ("WASD", "drive"), ("␣", "stop"), ("1-5", "gear"), ("E", "ESTOP"),
    ("R", "reset"), ("FB", "release"), ("ZC", "arcs"), ("Q", "quit"),
)  # fmt: skip
# End of each band of distances, in metres, and its colour. For display only: the distances at which
# safety acts depend on the speed.
BANDS = ((0.5, BAD), (1.0, WARN))
NO_RANGE = {"fault": ("fault", "bold magenta"), "too_near": ("near", BAD), "no_echo": ("-", DIM)}
AHEAD, BESIDE, BEHIND = (
    ("front_left", "front", "front_right"), ("left", "right"), ("rear_left", "rear", "rear_right"),
)  # fmt: skip


def rows_of(*rows: Text) -> Text:
    """Return texts one below the other."""
    return Text("\n", no_wrap=True).join(rows)


def header(view: View) -> Text:
    """Return the header: robot, connections, gear."""
    bus = ("● bus", GOOD) if view.connected else ("○ no router", BAD)
    gear = (f"gear {view.gear}/5", "bold")
    top = (f"{view.top.linear:.2f} m/s {view.top.angular:.2f} rad/s", "")
    hops = [_board(view), _bumper(view)] if view.connected else []  # unknown without a router
    shown = [gear, top] if view.safety else []  # a limit beside "no safety" looks live
    parts = [(f"T2 {view.robot}", "bold"), bus, *hops, *shown]
    return Text("  ", no_wrap=True).join(Text(*part) for part in parts)


def _board(view: View) -> Part:
    if view.link is None:
        missing = _root(view).part == "bridge"
        return ("○ bridge missing", BAD) if missing else ("○ no data of the bridge", WARN)
    if view.link.state == "up":
        return ("● board", GOOD)
    return ("○ board lost" if view.link.state == "lost" else "○ board never seen", BAD)


def _root(view: View) -> RootCause:
    return root_cause(view.connected, view.safety, view.link)


def _bumper(view: View) -> Part:
    if view.bumper is None:
        return ("○ bumper", WARN)
    return ("● bumper PRESSED", BAD) if view.bumper.pressed else ("● bumper", GOOD)


def hints(view: View, hold_first_s: float) -> Text:
    """Return the keys, and the limit of key repeats or why keys are refused."""
    keys: tuple[Part, ...] = SLOW_KEYS if view.keys_refused or not view.may_drive else KEYS
    if not view.may_drive:
        keys = keys[1 if view.may_stop else 2 :]
    row = Text(" ", no_wrap=True).join(Text.assemble((key, KEY), f" {what}") for key, what in keys)
    if not view.may_drive:
        return row
    if view.keys_refused:
        return row.append(f"  KEYS OFF: {view.keys_refused}\n{ADVICE.capitalize()}.", style=BAD)
    if view.keys_muted:
        return row.append(f"\nKEYS OFF: release all keys for {hold_first_s:g} s", style=BAD)
    if view.key_notice:
        return row.append(f"\n{view.key_notice[0].upper()}{view.key_notice[1:]}", style=BAD)
    limit = (
        f"\nNo key-up in terminals: a tap drives {hold_first_s:g} s, "
        f"a hold {HOLD_S:g} s past its last repeat"
    )
    return row.append(limit, style=DIM)


def events(view: View, rows: int, width: int = 200) -> Text:
    """Return the newest event lines that fit, the newest last, wrapped to the width."""
    shown: list[Text] = []
    for line in reversed(view.lines):
        if len(shown) >= rows:
            break
        shown = [*_wrapped(line, max(MIN_TEXT, width - PREFIX))[: rows - len(shown)], *shown]
    return rows_of(*shown)


def _wrapped(line: Line, width: int) -> list[Text]:
    first, *rest = wrap(line.text, width, break_on_hyphens=False) or [""]
    style = LEVELS[line.level]
    time = f"{datetime.fromtimestamp(line.t_ns / 1e9):%H:%M:%S} "
    head = Text.assemble((time, DIM), (f"{line.service:<7} ", "cyan"), (first, style))
    return [head, *(Text(" " * PREFIX + more, style=style) for more in rest)]


# --- safety ---------------------------------------------------------------------------------


def safety(view: View, rows: int, width: int = 200) -> Text:
    """Return alarm, verdict, release and causes, latched ones first; by name if rows are short.

    Alarm and verdict are wrapped. These, the release and one row of causes may be more than rows.
    """
    width = max(MIN_TEXT, width)
    state, lines = view.safety, [Text(row, style=BAD) for row in wrap(view.alarm, width)]
    if state is None:
        badge, text = (
            (" NO SAFETY ", f"no state of safety arrives through {view.router}")
            if view.connected
            else (" NO ROUTER ", f"no answer at {view.router}")
        )
        lines += _verdict(badge, BADGES["inhibited"], text, width)
        return rows_of(*lines, Text(f"To stop, use the vehicle's own switch. Next: {view.doctor}"))
    badge, root = f" {state.verdict.upper()} ", _root(view)
    is_ours = view.may_drive and view.requested is not None  # another terminal has the same name
    own = f"{view.source} is in control."
    text = state.text.replace(own, "You are in control." if is_ours else own)
    if root.part in TEXTS:
        text = f"{TEXTS[root.part]} Next: {view.doctor}"
    lines += _verdict(badge, BADGES[state.verdict], text, width)
    lines += release(view)
    return rows_of(*lines, *_causes(state, root, max(1, rows - len(lines))))


def _verdict(badge: str, style: str, text: str, width: int) -> list[Text]:
    indent = " " * (len(badge) + 1)
    first, *rest = wrap(text, width, initial_indent=indent, break_on_hyphens=False) or [indent]
    return [Text.assemble((badge, style), first[len(badge) :]), *map(Text, rest)]


def release(view: View) -> list[Text]:
    """Return how to move off a pressed bumper, in two rows; nothing while safety refuses that."""
    known = view.safety.release if view.safety else None
    if known is None or (view.bumper is not None and not view.bumper.pressed):
        return []
    if _root(view).part or known.left <= 0 or len(known.forbidden) == len(DIRECTIONS):
        return []
    held = view.requested.release if view.requested else "none"
    keys = Text("   ").join(_key(known, direction, held) for direction in DIRECTIONS)
    return [_believed(known), keys.append(f"   {known.left:.2f} m left until reset", style="bold")]


def _believed(known: Release) -> Text:
    if known.believed_free is None:
        return Text.assemble("RELEASE  free direction ", ("unknown: look at the vehicle", BAD))
    came = DIRECTIONS[known.believed_free][1]
    age = "" if known.age is None else f", {_age(known.age)} ago"
    return Text.assemble(
        "RELEASE  believed free: ", (known.believed_free.upper(), GOOD),
        f" (moved {came}{age}; net {known.travelled:+.2f} m)",
    )  # fmt: skip


def _key(known: Release, direction: Direction, held: str) -> Text:
    key = (f" {DIRECTIONS[direction][0]} ", HELD if held == direction else KEY)
    if direction in known.forbidden:
        return Text.assemble(key, f" {direction} ", ("FORBIDDEN", BAD))
    return Text.assemble(key, f" {direction}", (", held" if held == direction else "", WARN))


def _causes(state: SafetyState, root: RootCause, rows: int) -> list[Text]:
    """Return one row per cause, or all names in one row if there are too few rows."""
    hidden = ("no_request", *root.folded)
    causes = [cause for cause in state.causes if cause.name not in hidden]
    causes.sort(key=lambda cause: cause.name not in state.latched)
    if len(causes) <= rows:
        return [_cause(cause, cause.text, state) for cause in causes]
    return [Text("  ").join(_cause(cause, cause.name, state) for cause in causes)]


def _cause(cause: Cause, text: str, state: SafetyState) -> Text:
    latched = cause.name in state.latched
    tag = ("LATCHED ", BAD) if latched else (f"{cause.action} ", WARN)
    return Text.assemble(tag, text, (f" {_age(cause.age)}", DIM))


def _age(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"


# --- sonars ---------------------------------------------------------------------------------


def around(view: View) -> Text:
    """Return the vehicle from above with the readings of its eight sonars."""
    bumper = view.bumper is not None and view.bumper.pressed
    style, label = ("bold white on red", "BUMPER") if bumper else ("bold cyan", "▲")
    read = {name: reading(view.ultrasonic, at) for at, name in enumerate(SONAR_NAMES)}
    left, right = (read[name] for name in BESIDE)
    space = (" " * 11, "")
    return rows_of(
        Text.assemble(*(read[name] for name in AHEAD)),
        Text.assemble(space, ("╭─────────╮", style), space),
        Text.assemble(left, (f"│{label:^9}│", style), right),
        Text.assemble(space, ("╰─────────╯", style), space),
        Text.assemble(*(read[name] for name in BEHIND)),
    )


def reading(ultrasonic: Ultrasonic | None, at: int) -> Part:
    """Return a sonar's reading, 11 characters wide; "?" without a fresh message."""
    if ultrasonic is None:
        return (f"{'?':^11}", DIM)
    status, distance = ultrasonic.status[at], ultrasonic.ranges[at]
    if status != "ok" or distance is None:
        text, style = NO_RANGE.get(status, NO_RANGE["no_echo"])
        return (f"{text:^11}", style)
    style = next((style for end, style in BANDS if distance < end), GOOD)
    return (f"{f'{distance:.2f} m':^11}", style)


# --- motion ---------------------------------------------------------------------------------


def motion(view: View) -> Text:
    """Return the table of ten rows."""
    rows = {
        "": Text(f"{'request':>8}{'allowed':>9}{'measured':>10}", style=DIM),
        **_speeds(view),
        **_pose(view),
        "board": _link(view),
        "motor L": Text(*_faults(view.left)),
        "motor R": Text(*_faults(view.right)),
        "driver": _driver(view),
        "gamepad": Text(view.gamepad_notice, WARN) if view.gamepad_notice else Text(view.gamepad),
    }
    return rows_of(*(Text.assemble((f"{name:<8}", DIM), row) for name, row in rows.items()))


def _speeds(view: View) -> dict[str, Text]:
    requested, measured = view.requested, view.velocity
    linear = angular = None
    if view.safety:
        limits = view.safety.limits
        backward = requested is not None and requested.linear < 0
        linear, angular = limits.backward if backward else limits.forward, limits.angular
    return {
        name: _triple(getattr(requested, axis, None), allowed, getattr(measured, axis, None))
        for name, axis, allowed in (("m/s", "linear", linear), ("rad/s", "angular", angular))
    }


def _triple(requested: float | None, allowed: float | None, measured: float | None) -> Text:
    short = requested is not None and allowed is not None and abs(requested) > allowed + 0.005
    return Text.assemble(
        (f"{_signed(requested):>8}", "bold" if requested else ""),
        (f"{'-' if allowed is None else f'{allowed:.2f}':>9}", WARN if short else ""),
        (f"{_signed(measured):>10}", "bold cyan" if measured else ""),
    )


def _signed(value: float | None) -> str:
    return "-" if value is None else f"{value + 0.0:+.2f}"


def _pose(view: View) -> dict[str, Text]:
    at = view.odometry
    if at is None:
        return {name: Text(*NO_DATA) for name in ("pose", "odom")}
    residual = "-" if at.residual is None else f"{at.residual:+.3f} m"
    slip = ("SLIP", WARN) if at.slip else ("no slip", GOOD)
    return {
        "pose": Text(f"x {at.x:+.2f}  y {at.y:+.2f} m  {math.degrees(at.heading):+.0f}°"),
        "odom": Text.assemble(f"residual {residual}  ", slip),
    }


def _link(view: View) -> Text:
    link = view.link
    if link is None:
        return Text(*NO_DATA)
    if link.state != "up":
        return Text(f"{link.state}: {link.board}", style=BAD)
    if not link.armed:
        return Text(link.waiting or "not armed", style=WARN)
    trip = "" if link.round_trip is None else f"  {link.round_trip * 1e3:.1f} ms"
    return Text(f"{link.board}{trip}", style=GOOD)


def _faults(driver: Driver | None) -> Part:
    if driver is None:
        return NO_DATA
    return (" ".join(driver.faults), BAD) if driver.faults else ("ok", GOOD)


def _driver(view: View) -> Text:
    if view.requested and view.requested.release != "none":
        return Text(f"you, release {view.requested.release}", style=WARN)
    driving = view.safety.source if view.safety else None
    if driving is None:
        return Text("none", style=DIM)
    return Text(f"{driving} (you)" if driving == view.source else driving, style="bold")
