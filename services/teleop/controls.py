"""The operator's input: keys and a gamepad, a gear, turbo, and the release off a pressed bumper.

Keys win over the gamepad. ``f`` or ``b`` held asks for a release forward or backward and excludes
driving; the last one that was pressed counts. Turbo is armed by ``t`` and good for one hold, so
that nobody drives off fast by a key of ten minutes ago; CapsLock changes nothing.
"""

from common.messages import Direction
from common.motion import Twist
from common.requests import Phase, Requests
from services.teleop.config import Teleop
from services.teleop.gamepad_watchdog import GamepadWatchdog
from services.teleop.hold import Deadman, Keys
from services.teleop.mapping import DIRECTIONS, Deflection, Stick, deflection, shaped, twist

RELEASE: dict[str, Direction] = {"f": "forward", "b": "backward"}
TURBO = "t"
STOP = "space"


class Controls:
    """Turns presses and sticks into requests; ``tick`` is due at the request rate."""

    def __init__(self, settings: Teleop) -> None:
        self.gear = 1
        self.turbo = False
        self._settings = settings
        self._keys = Keys(settings.hold_first, settings.hold)
        self._release = Keys(settings.hold_first, settings.hold)
        self._deadman = Deadman()
        self._watchdog = GamepadWatchdog(settings.gamepad_silence)
        self._by_gamepad = False
        self.gamepad_expired = False  # it was deflected and silent; until it drives again
        self._requests = Requests()

    @property
    def silent(self) -> bool:
        """Whether nothing is being sent."""
        return self._requests.phase is Phase.SILENT

    def press(self, key: str, now_ns: int) -> None:
        """Take a key press or its repeat; a key that means nothing is ignored."""
        if key in DIRECTIONS:
            self._release.clear()
            self._keys.press(key, now_ns)
        elif key in RELEASE:
            self.let_go()
            self._release.press_alone(key, now_ns)
        elif key == STOP:
            self.stop()
        elif key == TURBO:
            self.turbo = not self.turbo
        elif key in {"1", "2", "3", "4", "5"}:
            self.gear, self.turbo = int(key), False

    def let_go(self) -> None:
        """Release keys and gamepad; a gamepad's deadman must come up before it counts again."""
        self._keys.clear()
        self._deadman.drop()

    def cut(self, now_ns: int) -> None:
        """Let go of everything, and want it let go by hand, too, before it counts again."""
        self.mute_keys(now_ns)
        self._deadman.drop()

    def mute_keys(self, now_ns: int) -> None:
        """Release the keys; they count again once none has come for a while."""
        self._keys.mute(now_ns)
        self._release.mute(now_ns)

    def stop(self) -> None:
        """Let go of everything and send zeros even if nothing was sent before."""
        self.let_go()
        self._release.clear()
        self.turbo = False
        self._requests.stop()

    def released(self, now_ns: int) -> Direction | None:
        """Return the direction of the release that the operator holds; None if neither."""
        return next((RELEASE[key] for key in self._release.held(now_ns)), None)

    def holds_keys(self, now_ns: int) -> bool:
        """Return whether a key is held that moves the vehicle."""
        return bool(self._keys.held(now_ns) or self._release.held(now_ns))

    def gamepad_is_due(self, now_ns: int) -> bool:
        """Return whether the gamepad drives and should be moved to keep driving."""
        return self._by_gamepad and self._watchdog.is_due(now_ns)

    def tick(self, stick: Stick | None, now_ns: int) -> Twist | None:
        """Return the request to send now, None for silence; ``stick`` is None without gamepad."""
        was_driving = self._requests.phase is Phase.DRIVING
        request = self._requests.tick(self._held(stick, now_ns))
        if was_driving and self._requests.phase is not Phase.DRIVING:
            self.turbo = False
        return request

    def _held(self, stick: Stick | None, now_ns: int) -> Twist | None:
        self._watchdog.update(stick.events if stick else None, now_ns)
        self._by_gamepad = False
        gripped = self._grip(stick)
        if keys := self._keys.held(now_ns):
            return twist(deflection(keys), self.gear, self.turbo, self._settings)
        if gripped is None or self.released(now_ns):
            return None
        return self._pushed(gripped, now_ns)

    def _pushed(self, stick: Stick, now_ns: int) -> Twist | None:
        """Return the request of a gamepad whose deadman counts."""
        push = shaped(stick.push, self._settings.deadzone, self._settings.expo)
        self._by_gamepad = push != Deflection()
        self.gamepad_expired = self._by_gamepad and self._watchdog.is_expired(now_ns)
        if self.gamepad_expired:
            self._by_gamepad = False
            self._deadman.drop()
            return None
        return twist(push, self.gear, self.turbo or stick.turbo, self._settings)

    def _grip(self, stick: Stick | None) -> Stick | None:
        """Return the gamepad while its deadman counts."""
        if stick is None:
            self._deadman.drop()
            return None
        return stick if self._deadman.held(stick.deadman) else None
