"""One robot on the bus: what it says is heard, what its driver holds is asked; in the node's loop.

Each robot has a bus of its own, which opens when the first viewer looks at it.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import msgspec

from common import keys
from common import messages as m
from common.bus.bus import Arrival, Bus
from common.codec import finite
from common.freshness import NS_PER_S
from common.keys import Call, Topic
from common.log import Logger
from common.motion import Twist
from common.operator import CONFIRM_S, confirms, release_request, reset_request
from common.requests import Phase, Requests
from common.source import DriveSource
from services.dashboard.config import Dashboard
from services.dashboard.driver_lock import Wheel
from services.dashboard.sectors import Protection
from services.dashboard.snapshot_log import Snapshots
from services.dashboard.telemetry_cache import Heard, path_of
from services.dashboard.trail import Trail

R = TypeVar("R", bound=msgspec.Struct)
Tell = Callable[[m.Level, str], None]

PLAIN: tuple[Topic[Any], ...] = (
    keys.VELOCITY, keys.ULTRASONIC, keys.BUMPER, keys.LINK, keys.SWITCHES,
    keys.ODOMETRY, keys.SAFETY, keys.MOTION,
)  # fmt: skip
WILD_DEPTH = 16  # of a key that many publish on at the same time
RELEASE_TIMEOUT_S = 0.3
ESTOP_TICKS = 60  # an emergency stop is repeated until safety says that it is latched, or 3 s
PROTECTION = {name: f"safety.{name}" for name in Protection.__struct_fields__}


@dataclass(frozen=True, slots=True)
class Unconfirmed:
    """A reset that was answered, and whose effect safety's state has not shown yet."""

    seen: m.SafetyState
    done: m.ResetDone
    since_ns: int
    tell: Tell


class Robot:
    """What is known of a robot, and the one way to it; ``tick`` is due 20 times a second."""

    def __init__(
        self,
        bus: Bus,
        settings: Dashboard,
        broadcast: Tell,
        tell: Callable[[str, m.Level, str], None],
    ) -> None:
        self.bus = bus
        self.heard = Heard()
        self.trail = Trail()
        self.protection = Protection()
        self.wheel = Wheel(settings.round_trip)
        self.snapshots = Snapshots()
        self.wanted_ns = 0  # when somebody looked at it or stopped it last
        self.said_path = False  # whether the trail began anew since the viewers got it
        self._settings = settings
        self._broadcast = broadcast  # to all who look at this robot
        self._tell = tell  # one viewer
        self._requests = Requests()
        self._source = DriveSource(bus, settings.source)
        self._estops = 0  # ticks for which the emergency stop is still repeated
        self._releasing = self._release_pending = False
        self._release_answer = ""
        self._resets: list[Unconfirmed] = []
        self._asked_around = False
        self._log = Logger(robot=bus.robot)
        for topic in PLAIN:
            bus.subscribe(topic, self._hear)
        for side in ("left", "right"):
            bus.subscribe(keys.DRIVER, self._hear, side=side)
        bus.subscribe(keys.DRIVE, self._hear, depth=WILD_DEPTH, source="*")
        bus.subscribe(keys.HEALTH, self._hear, depth=WILD_DEPTH, service="*")
        bus.subscribe(keys.EVENTS, self._hear_event, depth=WILD_DEPTH, service="*")
        bus.watch_live(keys.live_key(bus.robot, "*", "*"), self.heard.lives)

    # --- the loop -----------------------------------------------------------------------------

    def tick(self, now_ns: int) -> None:
        """Ask what is held, repeat what is not confirmed."""
        safety = self.heard.newest(keys.SAFETY, now_ns)
        if safety is None:
            self.wheel.lapse()  # what comes back must not drive
        elif not self._asked_around:
            self._ask_around()
        self._repeat_estop(safety)
        push = self.wheel.held(now_ns)
        request = self._requests.tick(None if push is None or push.release else self._twist())
        if request is not None:
            self._ask(request)
        self._release(push.release if push else None, now_ns)
        self._confirm(safety, now_ns)
        self._follow(now_ns)

    @property
    def silent(self) -> bool:
        """Whether nothing is being asked."""
        return self._requests.phase is Phase.SILENT and not self._releasing

    def rest(self) -> None:
        """Let go, with zeros."""
        if self.wheel.driver is not None:
            self.wheel.leave(self.wheel.driver)

    def estop(self, who: str) -> None:
        """Stop the robot; asked again until safety has latched it."""
        self.wheel.lapse()
        self._requests.stop()
        self.bus.estop()
        if not self._estops:
            self._log.warning("emergency stop", asked_by=who)
        self._estops = ESTOP_TICKS

    def reset(self, seen: m.SafetyState, tell: Tell) -> None:
        """Clear the causes that were latched in this state; report its confirmation later."""

        def answered(done: m.ResetDone) -> None:
            self._resets.append(Unconfirmed(seen, done, time.monotonic_ns(), tell))

        self.bus.ask(
            keys.RESET, reset_request(seen), answered, lambda reason: tell("warning", reason)
        )

    def switch(self, seen: m.SafetyState, to: m.SwitchesRequest, tell: Tell) -> None:
        """Set the board's emergency brakes, as an operator who saw this state."""
        self.call(keys.SET_SWITCHES, msgspec.structs.replace(to, echo=seen.heartbeat), tell)

    def call(self, call: Call[Any, R], request: msgspec.Struct, tell: Tell) -> None:
        """Ask a service of the robot, and tell what it answers."""
        self.bus.ask(
            call,
            request,
            lambda reply: tell("info", reply.text if isinstance(reply, m.Done) else "done"),
            lambda reason: tell("warning", reason),
        )

    # --- inside -------------------------------------------------------------------------------

    def _ask(self, request: Twist) -> None:
        was_barred = self._source.barred
        self._source.ask(request.linear, request.angular)
        if self._source.barred and not was_barred:
            self._broadcast("error", "barred")

    def _twist(self) -> Twist:
        push, gear = self.wheel.push, self.wheel.gear - 1
        linear, angular = self._settings.gears_linear[gear], self._settings.gears_angular[gear]
        return Twist(push.linear * linear, push.angular * angular)

    def _hear(self, arrival: Arrival[Any]) -> None:
        self.heard.hear(path_of(arrival.key), arrival.message, arrival.received_ns)

    def _hear_event(self, arrival: Arrival[m.Event]) -> None:
        self.heard.note(arrival.key.rpartition("/")[2], arrival.message)

    def _repeat_estop(self, safety: m.SafetyState | None) -> None:
        if not self._estops:
            return
        if safety is not None and "estop" in safety.latched:
            self._estops = 0
            return
        self.bus.estop()
        self._estops -= 1
        if not self._estops:
            self._broadcast("error", "estop_unconfirmed")

    def _confirm(self, state: m.SafetyState | None, now_ns: int) -> None:
        """Report which resets safety's state confirms, and which it did not in time."""
        waiting, self._resets = self._resets, []
        for reset in waiting:
            if state is not None and confirms(reset.seen, reset.done, state):
                reset.tell("info", reset.done.text)
            elif now_ns - reset.since_ns > CONFIRM_S * NS_PER_S:
                reset.tell("error", "reset_unconfirmed")
            else:
                self._resets.append(reset)

    def _release(self, direction: m.Direction | None, now_ns: int) -> None:
        """Repeat the call while held, one at a time; end it at once on release."""
        if direction is None:
            if self._releasing:
                self._releasing, self._release_answer = False, ""
                newest = self.heard.newest(keys.SAFETY, now_ns)
                self._ask_release(release_request(newest, None, held=False))
            return
        limit_s = self._settings.round_trip
        seen = self.snapshots.seen(self.wheel.answered, now_ns, limit_s)
        if seen is not None and not self._release_pending:
            self._release_pending = self._releasing = True
            self._ask_release(release_request(seen, direction, held=True))

    def _ask_release(self, request: m.ReleaseRequest) -> None:
        self.bus.ask(
            keys.RELEASE,
            request,
            lambda done: self._release_answered("info", done.text),
            lambda reason: self._release_answered("warning", reason),
            timeout_s=RELEASE_TIMEOUT_S,
        )

    def _release_answered(self, level: m.Level, text: str) -> None:
        self._release_pending = False
        driver = self.wheel.driver
        if self._releasing and driver is not None and text != self._release_answer:
            self._release_answer = text
            self._tell(driver, level, text)

    def _follow(self, now_ns: int) -> None:
        odometry = self.heard.newest(keys.ODOMETRY, now_ns)
        if odometry is None or not finite(odometry.x, odometry.y):
            return
        if self.trail.add(odometry.x, odometry.y, odometry.epoch):
            self.said_path = False

    # --- what a newcomer asks -----------------------------------------------------------------

    def _ask_around(self) -> None:
        """Learn what safety reckons with, and where the robot has been."""
        self._asked_around = True
        self.bus.look_up("safety", "config", self._learn_protection, self._ask_later)
        self.bus.look_up("odom", "path", self._learn_path, lambda _: None)

    def _ask_later(self, _: str) -> None:
        self._asked_around = False

    def _learn_protection(self, answer: bytes) -> None:
        given = msgspec.json.decode(answer)
        values = {name: given[path]["value"] for name, path in PROTECTION.items() if path in given}
        self.protection = msgspec.convert(values, Protection)

    def _learn_path(self, answer: bytes) -> None:
        given = msgspec.json.decode(answer)
        points = [(round(x, 3), round(y, 3)) for x, y, _ in given["points"]]
        self.trail.begin(points, given["epoch"])
        self.said_path = False
