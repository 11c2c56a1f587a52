"""The panels of the screen: functions from the view to styled text, in the language of labels."""

import math
from datetime import datetime

from rich.text import Text

from common.root_cause import RootCause, root_cause
from common.text import line
from services.teleop.cells import centred, fitted, left, right, wrap
from services.teleop.core.hold import HOLD_S
from services.teleop.event_log import Line
from services.teleop.labels import Labels
from services.teleop.view import BELOW_SAFETY, View
from t2.messages import (
    SONAR_NAMES,
    Cause,
    Direction,
    Driver,
    Odometry,
    Phrase,
    Release,
    SafetyState,
    Ultrasonic,
    Verdict,
)

Part = tuple[str, str]  # text and its style

GOOD, WARN, BAD, DIM = "green", "bold yellow", "bold red", "grey58"
CAP = "bold black on cyan"  # of a keystroke
HELD = "bold black on yellow"
DIRECTIONS: dict[Direction, tuple[str, Direction]] = {  # keystroke and opposite direction
    "forward": ("F", "backward"), "backward": ("B", "forward"),
}  # fmt: skip
BADGES: dict[Verdict, str] = {
    "run": "bold black on green",
    "slow": "bold black on yellow",
    "stop": "bold black on yellow",
    "brake": "bold white on red",
    "inhibited": "bold white on grey35",
}
SERVICE, PREFIX, MIN_TEXT = 9, len("00:00:00 dashboard "), 20  # columns of an event line
LEVELS = {"info": "", "warning": WARN, "error": BAD}
# Keystrokes and the names of their labels; those of SLOW are accepted from a slow terminal.
SLOW = (("␣", "stop"), ("E", "estop"), ("Q", "quit"))
KEYSTROKES = (
    ("WASD", "drive"), ("␣", "stop"), ("1-5", "gear"), ("E", "estop"),
    ("R", "reset"), ("FB", "release"), ("ZC", "arcs"), ("Q", "quit"),
)  # fmt: skip
# End of each band of distances, in metres, and its colour. For display only: the distances at which
# safety acts depend on the speed.
BANDS = ((0.5, BAD), (1.0, WARN))
NO_RANGE = {"fault": "bold magenta", "too_near": BAD, "no_echo": DIM}
SONAR = 11  # columns of a reading
AHEAD, BESIDE, BEHIND = (
    ("front_left", "front", "front_right"), ("left", "right"), ("rear_left", "rear", "rear_right"),
)  # fmt: skip
NAME, VALUE = 8, 32  # columns of the motion panel
HEAD = (("request", 8), ("allowed", 9), ("measured", 10))


def rows_of(*rows: Text) -> Text:
    """Return texts one below the other."""
    return Text("\n", no_wrap=True).join(rows)


def header(view: View, say: Labels) -> Text:
    """Return the header: robot, connections, gear."""
    bus = ("bus.up", GOOD) if view.connected else ("bus.no_router", BAD)
    hops = [_board(view), _bumper(view)] if view.connected else []  # unknown without a router
    parts = [(f"T2 {view.robot}", "bold"), *((say(name), style) for name, style in (bus, *hops))]
    if view.safety:  # a limit beside "no safety" looks live
        top = say("top", linear=view.top.linear, angular=view.top.angular)
        parts += [(say("gear", gear=view.gear), "bold"), (top, "")]
    return Text("  ", no_wrap=True).join(Text(*part) for part in parts)


def _board(view: View) -> Part:
    if view.link is None:
        is_missing = _root(view).part == "bridge"
        return ("bridge.missing", BAD) if is_missing else ("bridge.no_data", WARN)
    return f"board.{view.link.state}", GOOD if view.link.state == "up" else BAD


def _root(view: View) -> RootCause:
    return root_cause(view.connected, view.safety, view.link)


def _bumper(view: View) -> Part:
    if view.bumper is None:
        return "bumper.unknown", WARN
    return ("bumper.pressed", BAD) if view.bumper.pressed else ("bumper.free", GOOD)


def hints(view: View, say: Labels, first_s: float) -> Text:
    """Return the keystrokes, and the limit of repeats or why keystrokes are refused."""
    shown: tuple[Part, ...] = SLOW if view.keyboard_refused or not view.may_drive else KEYSTROKES
    if not view.may_drive:
        shown = shown[1 if view.may_stop else 2 :]
    row = Text(" ", no_wrap=True).join(
        Text.assemble((cap, CAP), f" {say(f'hint.{name}')}") for cap, name in shown
    )
    if not view.may_drive:
        return row
    if view.keyboard_refused:
        why = say("keyboard.off", why=say.render(view.keyboard_refused))
        return row.append(f"  {why}\n{say('terminal.advice')}", style=BAD)
    if view.keyboard_muted:
        return row.append(f"\n{say('keyboard.muted', seconds=first_s)}", style=BAD)
    if view.keystroke_notice:
        return row.append(f"\n{say.render(view.keystroke_notice)}", style=BAD)
    return row.append(f"\n{say('keyboard.holds', first=first_s, repeat=HOLD_S)}", style=DIM)


def events(view: View, say: Labels, rows: int, width: int = 200) -> Text:
    """Return the newest event lines that fit, the newest last, wrapped to the width."""
    shown: list[Text] = []
    for one in reversed(view.lines):
        if len(shown) >= rows:
            break
        wrapped = _wrapped(one, say, max(MIN_TEXT, width - PREFIX))
        shown = [*wrapped[: rows - len(shown)], *shown]
    return rows_of(*shown)


def _wrapped(one: Line, say: Labels, width: int) -> list[Text]:
    first, *rest = wrap(line(say.render(one.phrases, one.text)), width) or [""]
    style = LEVELS[one.level]
    time = f"{datetime.fromtimestamp(one.t_ns / 1e9):%H:%M:%S} "
    head = Text.assemble(
        (time, DIM), (f"{left(say.service(one.service), SERVICE)} ", "cyan"), (first, style)
    )
    return [head, *(Text(" " * PREFIX + more, style=style) for more in rest)]


# --- safety ---------------------------------------------------------------------------------


def safety(view: View, say: Labels, rows: int, width: int = 200) -> Text:
    """Return alarm, verdict, release and causes, latched ones first; by name if rows are short.

    Alarm and verdict are wrapped. These, the release and one row of causes may be more than rows.
    """
    width = max(MIN_TEXT, width)
    state = view.safety
    lines = [Text(row, style=BAD) for row in wrap(say.render(view.alarm), width)]
    if state is None:
        name = "no_safety" if view.connected else "no_router"
        text = f"{say('text.own_switch')} {say(f'text.{name}')}"
        lines += _verdict(say(f"verdict.{name}"), BADGES["inhibited"], text, width)
        details = say(f"technician.{name}", router=view.router, doctor=view.doctor)
        return rows_of(*lines, *(Text(row, style="dim") for row in wrap(details, width)))
    root, text = _root(view), _summary(view, state, say)
    if root.part in BELOW_SAFETY:
        text = say.render(
            (Phrase(f"root.{root.part}"), Phrase("text.next", {"doctor": view.doctor}))
        )
    badge = say(f"verdict.{state.verdict}")
    if view.velocity is not None:
        badge += f" {_signed(view.velocity.linear)} m/s"
    lines += _verdict(badge, BADGES[state.verdict], text, width)
    lines += release(view, say)
    return rows_of(*lines, *_causes(state, root, say, max(1, rows - len(lines)), width))


def _summary(view: View, state: SafetyState, say: Labels) -> str:
    """Return safety's text; the operator in control is "you"."""
    is_ours = view.may_drive and view.requested is not None  # another terminal has the same name
    own, you = Phrase("control.of", {"source": view.source}), Phrase("control.you")
    phrases = [you if is_ours and phrase == own else phrase for phrase in state.phrases]
    return say.render(phrases, state.text)


def _verdict(badge: str, style: str, text: str, width: int) -> list[Text]:
    badge = f" {badge} "
    first, *rest = wrap(text, width, Text(badge).cell_len + 1) or [""]
    return [Text.assemble((badge, style), f" {first}"), *map(Text, rest)]


def release(view: View, say: Labels) -> list[Text]:
    """Return how to move off a pressed bumper, in two rows; nothing while safety refuses that."""
    known = view.safety.release if view.safety else None
    if known is None or (view.bumper is not None and not view.bumper.pressed):
        return []
    if _root(view).part or known.left <= 0 or len(known.forbidden) == len(DIRECTIONS):
        return []
    held = view.requested.release if view.requested else "none"
    ways = Text("   ").join(_way(known, direction, held, say) for direction in DIRECTIONS)
    left_m = say("off.left", left=known.left)
    return [_believed(known, say), ways.append(f"   {left_m}", style="bold")]


def _believed(known: Release, say: Labels) -> Text:
    if known.believed_free is None:
        return Text.assemble(say("off.unknown"), (say("off.look"), BAD))
    way = say("off.way", direction=known.believed_free).upper()
    came, travelled = DIRECTIONS[known.believed_free][1], known.travelled
    if known.age is None:
        moved = say("off.came", came=came, travelled=travelled)
    else:
        age = _age(known.age, say)
        moved = say("off.came_ago", came=came, travelled=travelled, age=age)
    return Text.assemble(say("off.believed"), (way, GOOD), moved)


def _way(known: Release, direction: Direction, held: str, say: Labels) -> Text:
    cap = (f" {DIRECTIONS[direction][0]} ", HELD if held == direction else CAP)
    way = f" {say('off.way', direction=direction)}"
    if direction in known.forbidden:
        return Text.assemble(cap, f"{way} ", (say("off.forbidden"), BAD))
    return Text.assemble(cap, way, (say("off.held") if held == direction else "", WARN))


def _causes(state: SafetyState, root: RootCause, say: Labels, rows: int, width: int) -> list[Text]:
    """Return one row per cause, or all names in one row if there are too few rows."""
    hidden = ("no_request", *root.folded)
    causes = [cause for cause in state.causes if cause.name not in hidden]
    causes.sort(key=lambda cause: cause.name not in state.latched)
    if len(causes) <= rows:
        return [
            _cause(cause, say.render(cause.phrases, cause.text), state, say, width)
            for cause in causes
        ]
    names = [
        _cause(cause, say.known(f"cause.{cause.name}", cause.name), state, say) for cause in causes
    ]
    return [Text("  ").join(names)]


def _cause(cause: Cause, text: str, state: SafetyState, say: Labels, width: int = 200) -> Text:
    is_latched = cause.name in state.latched
    name, style = ("cause.latched", BAD) if is_latched else (f"action.{cause.action}", WARN)
    tag, age = f"{say(name)} ", f" {_age(cause.age, say)}"
    text = fitted(text, max(MIN_TEXT, width - Text(tag + age).cell_len))
    return Text.assemble((tag, style), text, (age, DIM))


def _age(seconds: float, say: Labels) -> str:
    if seconds < 120:
        return say("age.seconds", seconds=seconds)
    return say("age.minutes", minutes=seconds / 60)


# --- sonars ---------------------------------------------------------------------------------


def around(view: View, say: Labels) -> Text:
    """Return the vehicle from above with the readings of its eight sonars."""
    is_hit = view.bumper is not None and view.bumper.pressed
    style, label = ("bold white on red", say("around.bumper")) if is_hit else ("bold cyan", "▲")
    read = {name: reading(view.ultrasonic, at, say) for at, name in enumerate(SONAR_NAMES)}
    beside_left, beside_right = (read[name] for name in BESIDE)
    space = (" " * SONAR, "")
    return rows_of(
        Text.assemble(*(read[name] for name in AHEAD)),
        Text.assemble(space, ("╭─────────╮", style), space),
        Text.assemble(beside_left, (f"│{centred(label, 9)}│", style), beside_right),
        Text.assemble(space, ("╰─────────╯", style), space),
        Text.assemble(*(read[name] for name in BEHIND)),
    )


def reading(ultrasonic: Ultrasonic | None, at: int, say: Labels) -> Part:
    """Return a sonar's reading, 11 columns wide; "?" without a fresh message."""
    if ultrasonic is None:
        return centred("?", SONAR), DIM
    status, distance = ultrasonic.status[at], ultrasonic.ranges[at]
    if status != "ok" or distance is None:
        known = status if status in NO_RANGE else "no_echo"
        return centred(say(f"sonar.{known}"), SONAR), NO_RANGE[known]
    style = next((style for end, style in BANDS if distance < end), GOOD)
    return centred(f"{distance:.2f} m", SONAR), style


# --- motion ---------------------------------------------------------------------------------


def motion(view: View, say: Labels) -> Text:
    """Return the table of ten rows."""
    head = "".join(right(say(f"motion.{name}"), columns) for name, columns in HEAD)
    notice = say.render(view.gamepad_notice)
    gamepad = (notice, WARN) if notice else (say.render((view.gamepad,)), "")
    rows = (
        ("", Text(head, style=DIM)),
        *_speeds(view),
        *_pose(view, say),
        ("board", _link(view, say)),
        ("motor_left", Text(*_faults(view.left, say))),
        ("motor_right", Text(*_faults(view.right, say))),
        ("driver", _driver(view, say)),
        ("gamepad", Text(fitted(gamepad[0], VALUE), gamepad[1])),
    )
    return rows_of(
        # A unit is the same in all languages.
        *(
            Text.assemble((left(say.known(f"motion.{name}", name), NAME), DIM), value)
            for name, value in rows
        )
    )


def _speeds(view: View) -> list[tuple[str, Text]]:
    requested, measured = view.requested, view.velocity
    linear = angular = None
    if view.safety:
        limits = view.safety.limits
        backward = requested is not None and requested.linear < 0
        linear, angular = limits.backward if backward else limits.forward, limits.angular
    return [
        (name, _triple(getattr(requested, axis, None), allowed, getattr(measured, axis, None)))
        for name, axis, allowed in (("m/s", "linear", linear), ("rad/s", "angular", angular))
    ]


def _triple(requested: float | None, allowed: float | None, measured: float | None) -> Text:
    short = requested is not None and allowed is not None and abs(requested) > allowed + 0.005
    return Text.assemble(
        (f"{_signed(requested):>8}", "bold" if requested else ""),
        (f"{'-' if allowed is None else f'{allowed:.2f}':>9}", WARN if short else ""),
        (f"{_signed(measured):>10}", "bold cyan" if measured else ""),
    )


def _signed(value: float | None) -> str:
    return "-" if value is None else f"{value + 0.0:+.2f}"


def _pose(view: View, say: Labels) -> list[tuple[str, Text]]:
    at = view.odometry
    if at is None:
        return [(name, Text(say("no_data"), DIM)) for name in ("pose", "odom")]
    residual = say("odom.no_residual")
    if at.residual is not None:
        residual = say("odom.residual", residual=at.residual)
    slip = (say("odom.slip"), WARN) if at.slip else (say("odom.no_slip"), GOOD)
    return [_position(view, at, say), ("odom", Text.assemble(residual, slip))]


def _position(view: View, at: Odometry, say: Labels) -> tuple[str, Text]:
    """Return the pose in the map once the vehicle is placed; before that, by odometry."""
    known = view.map_pose
    if known is None or known.x is None or known.y is None or known.heading is None:
        return "pose", Text(_pose_text(at.x, at.y, at.heading))
    text = _pose_text(known.x, known.y, known.heading)
    if known.state == "lost":
        return "map", Text(fitted(f"{say('lost')} {text}", VALUE), BAD)
    return "map", Text(text, GOOD)


def _pose_text(x: float, y: float, heading: float) -> str:
    return f"x {x:+.2f}  y {y:+.2f} m  {math.degrees(heading):+.0f}°"


def _link(view: View, say: Labels) -> Text:
    link = view.link
    if link is None:
        return Text(say("no_data"), DIM)
    if link.state != "up":
        return Text(fitted(say(f"to_board.{link.state}", board=link.board), VALUE), BAD)
    if not link.armed:
        waiting = say.short(link.waiting_phrases, link.waiting) or say("to_board.not_armed")
        return Text(fitted(waiting, VALUE), WARN)
    trip = "" if link.round_trip is None else f"  {link.round_trip * 1e3:.1f} ms"
    return Text(f"{link.board}{trip}", GOOD)


def _faults(driver: Driver | None, say: Labels) -> Part:
    if driver is None:
        return say("no_data"), DIM
    if not driver.faults:
        return say("motor.ok"), GOOD
    return fitted(say("motor.faults", faults=driver.faults), VALUE), BAD


def _driver(view: View, say: Labels) -> Text:
    if view.requested and view.requested.release != "none":
        return Text(say("driver.release", direction=view.requested.release), WARN)
    driving = view.safety.source if view.safety else None
    if driving is None:
        return Text(say("driver.none"), DIM)
    return Text(say("driver.you", source=driving) if driving == view.source else driving, "bold")
