"""The operator's input: keys, gamepad, gear, turbo, and the release off a pressed bumper.

Keys have priority over the gamepad. ``f`` or ``b``, held, requests a release forward or backward
and excludes driving; the last one pressed counts. ``t`` arms turbo for one hold only, so that an
old key press never causes a fast start. CapsLock makes no difference.

A key gives a direction, a stick a deflection: -1..1 on each of the two axes. The gear sets the
speed of full deflection, in ``base_link``: m/s and rad/s, counter-clockwise. Backward left means
that the rear goes left, as in a car.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from common import codec
from common.messages import Direction
from common.motion import Twist, clamp
from common.operator import DriveRequests, Phase, Request
from services.teleop.config import Teleop
from services.teleop.core.hold import Deadman, GamepadWatchdog, Keys

RELEASE: dict[str, Direction] = {"f": "forward", "b": "backward"}
TURBO = "t"
STOP = "space"


@dataclass(frozen=True, slots=True)
class Deflection:
    """Deflection of a control, -1..1: forward and counter-clockwise positive."""

    linear: float = 0.0
    angular: float = 0.0


@dataclass(frozen=True, slots=True)
class Stick:
    """State of a gamepad."""

    push: Deflection
    deadman: bool  # held down; without it the sticks are ignored
    turbo: bool
    events: int = 0  # received since the gamepad was found


# The keypad without NumLock sends home, pageup, end and pagedown from its corners. A terminal
# repeats one key only, so each arc has its own key.
DIRECTIONS = {
    "w": Deflection(1, 0), "up": Deflection(1, 0),
    "s": Deflection(-1, 0), "down": Deflection(-1, 0),
    "a": Deflection(0, 1), "left": Deflection(0, 1),
    "d": Deflection(0, -1), "right": Deflection(0, -1),
    "z": Deflection(1, 1), "home": Deflection(1, 1),
    "c": Deflection(1, -1), "pageup": Deflection(1, -1),
    "end": Deflection(-1, -1), "pagedown": Deflection(-1, 1),
}  # fmt: skip


class Controls:
    """Converts key presses and sticks to drive requests; ``tick`` runs at the request rate."""

    def __init__(self, settings: Teleop) -> None:
        self.gear = 1
        self.turbo = False
        self._settings = settings
        self._keys = Keys(settings.hold_first, settings.hold)
        self._release = Keys(settings.hold_first, settings.hold)
        self._deadman = Deadman()
        self._watchdog = GamepadWatchdog(settings.gamepad_silence)
        self._by_gamepad = False
        self.gamepad_expired = False  # deflected without events; until it drives again
        self._requests = DriveRequests()

    @property
    def silent(self) -> bool:
        """Whether no request is being sent."""
        return self._requests.phase is Phase.SILENT

    def press(self, key: str, now_ns: int) -> None:
        """Handle a key press or its repeat; unknown keys are ignored."""
        if key in DIRECTIONS:
            self._release.clear()
            self._keys.press(key, now_ns)
        elif key in RELEASE:
            self.release_all()
            self._release.press_alone(key, now_ns)
        elif key == STOP:
            self.stop()
        elif key == TURBO:
            self.turbo = not self.turbo
        elif key in {"1", "2", "3", "4", "5"}:
            self.gear, self.turbo = int(key), False

    def release_all(self) -> None:
        """Release keys and gamepad; the deadman must come up before it counts again."""
        self._keys.clear()
        self._deadman.drop()

    def cut(self, now_ns: int) -> None:
        """Release all input; the operator must release it, too, before it counts again."""
        self.mute_keys(now_ns)
        self._deadman.drop()

    def is_muted(self, now_ns: int) -> bool:
        """Return whether keys are ignored until there was a pause."""
        return self._keys.is_muted(now_ns)

    def mute_keys(self, now_ns: int) -> None:
        """Release the keys; they count again after a pause without keys."""
        self._keys.mute(now_ns)
        self._release.mute(now_ns)

    def stop(self) -> None:
        """Release all input and send zeros, even if nothing was sent before."""
        self.release_all()
        self._release.clear()
        self.turbo = False
        self._requests.stop()

    def released(self, now_ns: int) -> Direction | None:
        """Return the direction of the held release; None without one."""
        return next((RELEASE[key] for key in self._release.held(now_ns)), None)

    def holds_keys(self, now_ns: int) -> bool:
        """Return whether a key that moves the vehicle is held."""
        return bool(self._keys.held(now_ns) or self._release.held(now_ns))

    def gamepad_is_due(self, now_ns: int) -> bool:
        """Return whether the operator must move the stick to keep driving."""
        return self._by_gamepad and self._watchdog.is_due(now_ns)

    def tick(self, stick: Stick | None, now_ns: int) -> Request | None:
        """Return the request to send now, or None; ``stick`` is None without a gamepad."""
        was_driving = self._requests.phase is Phase.DRIVING
        twist, release = self._held(stick, now_ns), self.released(now_ns)
        held = (
            Request(release=release) if release else Request(twist) if twist is not None else None
        )
        request = self._requests.tick(held)
        if was_driving and self._requests.phase is not Phase.DRIVING:
            self.turbo = False
        return request

    def _held(self, stick: Stick | None, now_ns: int) -> Twist | None:
        self._watchdog.update(stick.events if stick else None, now_ns)
        self._by_gamepad = False
        enabled = self._enabled(stick)
        if keys := self._keys.held(now_ns):
            return twist(deflection(keys), self.gear, self.turbo, self._settings)
        if enabled is None or self.released(now_ns):
            return None
        return self._pushed(enabled, now_ns)

    def _pushed(self, stick: Stick, now_ns: int) -> Twist | None:
        """Return the twist of a gamepad whose deadman counts."""
        push = shaped(stick.push, self._settings.deadzone, self._settings.expo)
        self._by_gamepad = push != Deflection()
        self.gamepad_expired = self._by_gamepad and self._watchdog.is_expired(now_ns)
        if self.gamepad_expired:
            self._by_gamepad = False
            self._deadman.drop()
            return None
        return twist(push, self.gear, self.turbo or stick.turbo, self._settings)

    def _enabled(self, stick: Stick | None) -> Stick | None:
        """Return the gamepad's state while its deadman counts."""
        if stick is None:
            self._deadman.drop()
            return None
        return stick if self._deadman.held(stick.deadman) else None


def deflection(held: Iterable[str]) -> Deflection:
    """Return the deflection of all held keys; opposite keys cancel out."""
    pushes = [DIRECTIONS[key] for key in held]
    return Deflection(
        clamp(sum(push.linear for push in pushes), 1.0),
        clamp(sum(push.angular for push in pushes), 1.0),
    )


def shaped(raw: Deflection, deadzone: float, expo: float) -> Deflection:
    """Return a stick's deflection after deadzone and expo curve; full deflection stays 1."""
    return Deflection(_shape(raw.linear, deadzone, expo), _shape(raw.angular, deadzone, expo))


def twist(push: Deflection, gear: int, turbo: bool, settings: Teleop) -> Twist:
    """Return the twist of a deflection in a gear, 1 to 5; turbo replaces the gear."""
    linear = settings.turbo_linear if turbo else settings.gears_linear[gear - 1]
    angular = settings.turbo_angular if turbo else settings.gears_angular[gear - 1]
    return Twist(push.linear * linear, push.angular * angular)


def _shape(raw: float, deadzone: float, expo: float) -> float:
    if not codec.finite(raw) or abs(raw) <= deadzone:
        return 0.0
    linear = min(1.0, (abs(raw) - deadzone) / (1.0 - deadzone))
    curved = expo * linear**3 + (1.0 - expo) * linear
    return curved if raw > 0 else -curved
