"""What the operator's hands say: keys and a gamepad, a gear, turbo, and creeping off a bumper.

Keys win over the gamepad. ``f`` held means "creep off the bumper" and excludes driving; the last
of the two that was pressed counts. Turbo is armed by ``t`` and good for one hold, so that nobody
drives off fast by a key of ten minutes ago; CapsLock changes nothing.
"""

from common.requests import Phase, Requests, Twist
from services.teleop.config import Teleop
from services.teleop.hold import Deadman, Keys
from services.teleop.mapping import DIRECTIONS, Stick, deflection, shaped, twist

CREEP = "f"
TURBO = "t"
STOP = "space"


class Controls:
    """Turns presses and sticks into requests; ``tick`` is due at the request rate."""

    def __init__(self, settings: Teleop) -> None:
        self.gear = 1
        self.turbo = False
        self._settings = settings
        self._keys = Keys(settings.hold_first, settings.hold)
        self._creep = Keys(settings.hold_first, settings.hold)
        self._deadman = Deadman()
        self._requests = Requests()

    @property
    def silent(self) -> bool:
        """Whether nothing is being sent."""
        return self._requests.phase is Phase.SILENT

    def press(self, key: str, now_ns: int) -> None:
        """Take a key press or its repeat; a key that means nothing is ignored."""
        if key in DIRECTIONS:
            self._creep.clear()
            self._keys.press(key, now_ns)
        elif key == CREEP:
            self.let_go()
            self._creep.press(key, now_ns)
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
        self._keys.mute(now_ns)
        self._creep.mute(now_ns)
        self._deadman.drop()

    def stop(self) -> None:
        """Let go of everything and send zeros even if nothing was sent before."""
        self.let_go()
        self._creep.clear()
        self.turbo = False
        self._requests.stop()

    def creeping(self, now_ns: int) -> bool:
        """Tell whether the operator holds the key that creeps off a bumper."""
        return bool(self._creep.held(now_ns))

    def tick(self, stick: Stick | None, now_ns: int) -> Twist | None:
        """Return the request to send now, None for silence; ``stick`` is None without gamepad."""
        was_driving = self._requests.phase is Phase.DRIVING
        request = self._requests.tick(self._held(stick, now_ns))
        if was_driving and self._requests.phase is not Phase.DRIVING:
            self.turbo = False
        return request

    def _held(self, stick: Stick | None, now_ns: int) -> Twist | None:
        gripped = self._grip(stick)
        if keys := self._keys.held(now_ns):
            return twist(deflection(keys), self.gear, self.turbo, self._settings)
        if gripped is None or self.creeping(now_ns):
            return None
        push = shaped(gripped.push, self._settings.deadzone, self._settings.expo)
        return twist(push, self.gear, self.turbo or gripped.turbo, self._settings)

    def _grip(self, stick: Stick | None) -> Stick | None:
        """Return the gamepad while its deadman counts."""
        if stick is None:
            self._deadman.drop()
            return None
        return stick if self._deadman.held(stick.deadman) else None
