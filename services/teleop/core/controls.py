"""The operator's controls: keystrokes and gamepad to requests, 20 times a second.

A keystroke counts by its age, and by the round trip of the terminal:

========== ============================== ==================== =============
keystroke  older than ``MAX_PRESS_AGE_S`` ``round_trip`` slow  otherwise
========== ============================== ==================== =============
E, space   accepted                       accepted             accepted
R          LATE                           SLOW, rule           RESET
motion     LATE                           SLOW, rule           accepted
others     LATE                           accepted             accepted
unknown    UNKNOWN                        UNKNOWN              UNKNOWN
========== ============================== ==================== =============

``hold`` has the rules by which controls count as let go. Keystrokes have priority over the gamepad.
``f`` or ``b``, held, requests a release off a pressed bumper and excludes driving; the last one
pressed counts.

A keystroke gives a direction, a stick a deflection: -1..1 on each of the two axes. The gear sets
the speed of full deflection, in ``base_link``: m/s and rad/s, counter-clockwise. Backward left
means that the rear goes left, as in a car.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from common.motion import Twist, clamp
from common.settings import Vehicle
from services.teleop.config import Teleop
from services.teleop.core.hold import RULES, Deadman, HeldKeystrokes, Press
from services.teleop.core.round_trip import RoundTrip
from t2.client import DriveRequests, Phase, request
from t2.messages import Direction, Drive

MAX_PRESS_AGE_S = 0.5
EXPO = 0.5  # of a stick: 0 is straight, 1 is cubic
ESTOP, RESET, STOP, ACKNOWLEDGE = "e", "r", "space", "enter"
RELEASE: dict[str, Direction] = {"f": "forward", "b": "backward"}
GEARS = {"1": 1, "2": 2, "3": 3, "4": 4, "5": 5}


@dataclass(frozen=True, slots=True)
class Deflection:
    """Deflection of a control, -1..1: forward and counter-clockwise positive."""

    linear: float = 0.0
    angular: float = 0.0


@dataclass(frozen=True, slots=True)
class Stick:
    """State of the gamepad that drives."""

    push: Deflection
    deadman: bool  # held down; without it the sticks are ignored
    events: int = 0  # changes of its reading


# The keypad without NumLock sends home, pageup, end and pagedown from its corners. A terminal
# repeats one keystroke only, so each arc has its own.
DIRECTIONS = {
    "w": Deflection(1, 0), "up": Deflection(1, 0),
    "s": Deflection(-1, 0), "down": Deflection(-1, 0),
    "a": Deflection(0, 1), "left": Deflection(0, 1),
    "d": Deflection(0, -1), "right": Deflection(0, -1),
    "z": Deflection(1, 1), "home": Deflection(1, 1),
    "c": Deflection(1, -1), "pageup": Deflection(1, -1),
    "end": Deflection(-1, -1), "pagedown": Deflection(-1, 1),
}  # fmt: skip


KEYSTROKES = {ESTOP, RESET, STOP, ACKNOWLEDGE, *DIRECTIONS, *RELEASE, *GEARS}


class Action(Enum):
    """What a keystroke asks of the shell."""

    NONE = "none"
    ESTOP = "stop the vehicle"
    RESET = "reset the causes on the screen"
    LATE = "report a press that is too old"
    SLOW = "report a slow terminal"
    UNKNOWN = "report a keystroke without a function"


class Controls:
    """Held keystrokes and gamepad; ``tick`` runs at the request rate."""

    def __init__(self, settings: Teleop, vehicle: Vehicle) -> None:
        self.gear = 1
        self.terminal = RoundTrip(settings.round_trip)
        self.is_gamepad_silent = False  # deflected without a change; until its deadman is up
        self._settings, self._vehicle = settings, vehicle
        self._keystrokes = HeldKeystrokes(settings.hold_first)
        self._deadman = Deadman()
        self._by_gamepad = False  # whether a stick moves the vehicle
        self._requests = DriveRequests()

    @property
    def is_silent(self) -> bool:
        """Whether no request is being sent."""
        return self._requests.phase is Phase.SILENT

    def press(self, press: Press, now_ns: int) -> Action:
        """Process a press or its repeat."""
        keystroke = press.keystroke
        if keystroke in (ESTOP, STOP):
            self.stop(now_ns)
            return Action.ESTOP if keystroke == ESTOP else Action.NONE
        if keystroke not in KEYSTROKES:
            return Action.UNKNOWN
        if press.age_s(now_ns) > MAX_PRESS_AGE_S:
            return Action.LATE
        moves = keystroke in DIRECTIONS or keystroke in RELEASE
        if (moves or keystroke == RESET) and self.terminal.refusal(press.at_ns):
            self.enforce("terminal_slow", now_ns)
            return Action.SLOW
        if moves:
            self._keystrokes.keep(DIRECTIONS.keys() if keystroke in DIRECTIONS else {keystroke})
            self._keystrokes.press(keystroke, press.at_ns)
        if keystroke in RELEASE:
            self._deadman.drop()
        self.gear = GEARS.get(keystroke, self.gear)
        return Action.RESET if keystroke == RESET else Action.NONE

    def enforce(self, rule: str, now_ns: int) -> None:
        """Let go of what a rule of ``hold`` names."""
        self._keystrokes.let_go(RULES[rule].keystrokes, now_ns)
        if RULES[rule].deadman:
            self._deadman.drop()

    def stop(self, now_ns: int) -> None:
        """Let go of everything and send zeros, even if nothing was sent before."""
        self.enforce("stop", now_ns)
        self._requests.stop()

    def is_muted(self, now_ns: int) -> bool:
        """Return whether keystrokes are ignored until there was a pause."""
        return self._keystrokes.is_muted(now_ns)

    def holds_keystrokes(self, now_ns: int) -> bool:
        """Return whether a keystroke that moves the vehicle is held."""
        return bool(self._keystrokes.held(now_ns))

    def is_gamepad_due(self, now_ns: int) -> bool:
        """Return whether the operator must move the stick to keep driving."""
        return self._by_gamepad and self._deadman.is_due(now_ns)

    def top(self) -> Twist:
        """Return the twist of full deflection."""
        return twist(Deflection(1, 1), self.gear, self._vehicle)

    def tick(self, stick: Stick | None, now_ns: int) -> Drive | None:
        """Return the request to send now, or None; ``stick`` is None without a gamepad."""
        if stick is None:
            self.enforce("gamepad_gone", now_ns)
        else:
            self._deadman.update(stick.deadman, stick.events, now_ns)
        self.is_gamepad_silent = self.is_gamepad_silent and stick is not None and stick.deadman
        return self._requests.tick(self._held(stick, now_ns))

    def _held(self, stick: Stick | None, now_ns: int) -> Drive | None:
        self._by_gamepad = False
        held = self._keystrokes.held(now_ns)
        if held and held[0] in RELEASE:
            return request(release=RELEASE[held[0]])
        if held:
            return self._moving(deflection(held))
        if stick is None or not self._deadman.is_held:
            return None
        push = shaped(stick.push, self._settings.deadzone)
        moves = push != Deflection()
        self.is_gamepad_silent = moves and self._deadman.is_silent(now_ns)
        if self.is_gamepad_silent:
            self.enforce("gamepad_silent", now_ns)
            return None
        self._by_gamepad = moves
        return self._moving(push)

    def _moving(self, push: Deflection) -> Drive:
        moves = twist(push, self.gear, self._vehicle)
        return request(moves.linear, moves.angular)


def deflection(held: Iterable[str]) -> Deflection:
    """Return the deflection of all held keystrokes; opposite ones cancel out."""
    pushes = [DIRECTIONS[one] for one in held]
    return Deflection(
        clamp(sum(push.linear for push in pushes), 1.0),
        clamp(sum(push.angular for push in pushes), 1.0),
    )


def shaped(raw: Deflection, deadzone: float) -> Deflection:
    """Return a stick's deflection after deadzone and expo curve; full deflection stays 1."""
    return Deflection(_shape(raw.linear, deadzone), _shape(raw.angular, deadzone))


def twist(push: Deflection, gear: int, vehicle: Vehicle) -> Twist:
    """Return the twist of a deflection in a gear, 1 to 5."""
    linear, angular = vehicle.gears_linear[gear - 1], vehicle.gears_angular[gear - 1]
    return Twist(push.linear * linear, push.angular * angular)


def _shape(raw: float, deadzone: float) -> float:
    linear = max(0.0, min(1.0, (abs(raw) - deadzone) / (1.0 - deadzone)))
    return math.copysign(EXPO * linear**3 + (1.0 - EXPO) * linear, raw)
