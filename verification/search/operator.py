"""A random operator: holds keys or a stick through teleop's controls, and resets what stops.

An attentive beginner: drives some manoeuvres, turns to the next one when there is no room, lets go
when safety wants a neutral request, backs off a pressed bumper, and resets what is latched.
"""

import random
from typing import Any

from msgspec import Struct

from common.freshness import NS_PER_S
from common.settings import Vehicle
from services.teleop.config import Teleop
from services.teleop.core.controls import Controls, Deflection, Stick
from services.teleop.core.hold import Press
from t2 import keys
from t2 import messages as m
from verification.search.bus import MS, Source
from verification.search.draw import Draw
from verification.search.stack import Stack as Robot

RELEASE_KEYS: dict[m.Direction, str] = {"forward": "f", "backward": "b"}
KEYS = ("w", "w", "w", "w", "s", "s", "a", "d", "z", "c", "end", "pagedown")
TICK_S = 0.05
FROZEN_S = 2.0  # that a gamepad may drive after it froze
PATIENCE_S = 0.7  # without room, until the next manoeuvre
LET_GO_S = 0.4  # for a neutral request
LOOK_S = 1.2  # from a stop that is latched to the first call
BACK_OFF_S = 5.0  # of holding the release
CLEAR_NS = 400 * MS  # after the bumper is free
GIVE_UP_S = 25.0  # of trying to reset
RESET_NS = 500 * MS  # from one call to the next


class Manoeuvre(Struct, frozen=True):
    """One hold of a key or a stick, and the pause after it."""

    key: str
    push: Deflection
    hold_s: float
    pause_s: float


def script(draw: Draw) -> list[Manoeuvre]:
    """Return the manoeuvres of a draw."""
    chance = random.Random(f"{draw.seed} script")
    number = int(draw.get("operator.manoeuvres", 3))
    return [
        Manoeuvre(
            chance.choice(KEYS),
            Deflection(chance.choice((1, 1, 0.6, 0.3, 0, -0.6, -1)), chance.uniform(-1, 1)),
            chance.uniform(1.0, 6.0),
            chance.choice((0.3, 0.5, 1.0, 2.0)),
        )
        for _ in range(number)
    ]


class Operator(Source):
    """A source that sends what teleop's controls make of the script; ``act`` runs at 20 Hz."""

    def __init__(self, robot: Robot, draw: Draw) -> None:
        super().__init__("teleop", keys.DRIVE, robot.process("stick"))
        self.gave_up = False
        self.muted_until_ns: float = 0
        self.asks_since_ns: int | None = None  # of motion
        self._robot = robot
        self._pressed = False  # the bumper, as shown
        self._script = script(draw)[::-1]
        self._gamepad = draw.get("operator.device", "keyboard") == "gamepad"
        self._controls = Controls(Teleop(), Vehicle())
        self._controls.gear = int(draw.get("operator.gear", 3))
        self._events = 0
        self._stick = Stick(Deflection(), deadman=False)
        self._frozen_ns: int | None = None  # since when the gamepad keeps its reading
        self.violations: list[str] = []
        self._began_ns: int | None = None  # the current manoeuvre
        self._idle_until_ns = 0
        self._blocked_ns: int | None = None
        self._latched_ns: int | None = None
        self._free_ns: int | None = None  # the bumper, after a contact
        self.process.subscribe(keys.BUMPER, self._on_bumper)

    @property
    def done(self) -> bool:
        """Whether the script is finished, or cannot be."""
        return self.gave_up or not self._script

    def _on_bumper(self, arrival: Any) -> None:
        self._pressed = arrival.message.pressed

    def act(self) -> None:
        """Hold a key or the release, let go, or reset, until the next act."""
        now_ns, state = self.process.net.now_ns, self._robot.seen
        if state is None or self.done:
            return
        if state.latched:
            self._recover(state, now_ns)
        else:
            self._drive(state, now_ns)

    def publish(self) -> None:
        """Publish the request of this tick, if there is one."""
        now_ns = self.process.net.now_ns
        driving = self._began_ns is not None
        push = self._script[-1].push if driving and self._script else Deflection()
        if self._frozen_ns is None:
            self._stick = Stick(push, deadman=driving, events=self._events)
        request = self._controls.tick(self._stick if self._gamepad else None, now_ns)
        self.message = request
        moves = request is not None and not (request.linear == 0 == request.angular)
        frozen_s = (now_ns - (self._frozen_ns or now_ns)) / NS_PER_S
        if moves and self._gamepad and frozen_s > FROZEN_S + TICK_S:
            self.violations.append("a frozen gamepad drives")
        self.asks_since_ns = (self.asks_since_ns or now_ns) if moves else None
        if now_ns >= self.muted_until_ns:
            super().publish()

    def freeze(self, frozen: bool) -> None:
        """Freeze the gamepad in its reading, or end that; keys go on."""
        self._frozen_ns = self.process.net.now_ns if frozen else None

    def _drive(self, state: m.SafetyState, now_ns: int) -> None:
        self._latched_ns = self._free_ns = None
        if self._began_ns is None:
            if now_ns < self._idle_until_ns:
                return
            self._began_ns = now_ns
        causes = {cause.name for cause in state.causes}
        held_s = (now_ns - self._began_ns) / NS_PER_S
        if self._gamepad:
            self._events += 1
        else:
            self._press(self._script[-1].key, now_ns)
        self._blocked_ns = (self._blocked_ns or now_ns) if "blocked" in causes else None
        blocked_s = (now_ns - (self._blocked_ns or now_ns)) / NS_PER_S
        if held_s > self._script[-1].hold_s or blocked_s > PATIENCE_S:
            self._let_go(now_ns, self._script.pop().pause_s)
        elif "neutral" in causes and held_s > LET_GO_S:
            self._let_go(now_ns, LET_GO_S)

    def _press(self, key: str, now_ns: int) -> None:
        """Press a key of a terminal that answers at once."""
        self._controls.terminal.sent((0, 1), now_ns)
        self._controls.terminal.answered((0, 1), now_ns)
        self._controls.press(Press(key, now_ns), now_ns)

    def _let_go(self, now_ns: int, pause_s: float) -> None:
        if self._frozen_ns is None:  # a frozen gamepad shows no release
            self._controls.enforce("unfocused", now_ns)
        self._began_ns = self._blocked_ns = None
        self._idle_until_ns = now_ns + round(pause_s * NS_PER_S)

    def _recover(self, state: m.SafetyState, now_ns: int) -> None:
        """Wait, hold the release, reset."""
        if self._latched_ns is None:
            self._latched_ns = now_ns
            self._let_go(now_ns, LET_GO_S)
        self._began_ns = None
        self._idle_until_ns = now_ns + round(LET_GO_S * NS_PER_S)
        since_s = (now_ns - self._latched_ns) / NS_PER_S
        if since_s > GIVE_UP_S:
            self.gave_up = True
        elif since_s > LOOK_S:
            self._free_ns = None if self._pressed else self._free_ns or now_ns
            if self._free_ns is None and since_s < LOOK_S + BACK_OFF_S:
                if way := way_off(state.release):
                    self._press(RELEASE_KEYS[way], now_ns)
            elif now_ns % RESET_NS == 0 and now_ns - (self._free_ns or now_ns) > CLEAR_NS:
                self._robot.reset()


def way_off(release: m.Release | None) -> m.Direction | None:
    """Return the direction in which to move off the bumper; None without any."""
    if release is None:
        return None
    ways: tuple[m.Direction | None, ...] = release.believed_free, "backward", "forward"
    return next((way for way in ways if way and way not in release.forbidden), None)
