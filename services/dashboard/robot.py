"""One robot on the bus: what it says is heard, what its driver holds is asked; in the node's loop.

Each robot has a bus of its own, which opens when the first viewer looks at it.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import msgspec

from common import keys
from common import messages as m
from common.bus.bus import Arrival, Bus
from common.codec import finite
from common.keys import Call, Topic
from common.log import Logger
from common.requests import Phase, Requests, Twist
from common.source import DriveSource
from services.dashboard.config import Dashboard
from services.dashboard.heard import Heard, path_of
from services.dashboard.sectors import Protection
from services.dashboard.trail import Trail
from services.dashboard.wheel import Wheel

R = TypeVar("R", bound=msgspec.Struct)
Tell = Callable[[m.Level, str], None]

PLAIN: tuple[Topic[Any], ...] = (
    keys.VELOCITY, keys.ULTRASONIC, keys.BUMPER, keys.LINK, keys.SWITCHES,
    keys.ODOMETRY, keys.SAFETY, keys.MOTION,
)  # fmt: skip
WILD_DEPTH = 16  # of a key that many publish on at the same time
CREEP_TIMEOUT_S = 0.3
ESTOP_TICKS = 60  # an emergency stop is repeated until safety says that it is latched, or 3 s
PROTECTION = {name: f"safety.{name}" for name in Protection.__struct_fields__}


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
        self.wanted_ns = 0  # when somebody looked at it or stopped it last
        self.said_path = False  # whether the trail began anew since the viewers got it
        self._settings = settings
        self._broadcast = broadcast  # to all who look at this robot
        self._tell = tell  # one viewer
        self._requests = Requests()
        self._source = DriveSource(bus, settings.source)
        self._estops = 0  # ticks for which the emergency stop is still repeated
        self._creeping = self._creep_pending = False
        self._creep_answer = ""
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
        request = self._requests.tick(None if push is None or push.creep else self._twist())
        if request is not None:
            self._ask(request)
        self._creep(push is not None and push.creep)
        self._follow(now_ns)

    @property
    def silent(self) -> bool:
        """Whether nothing is being asked."""
        return self._requests.phase is Phase.SILENT and not self._creeping

    def rest(self) -> None:
        """Let go, with zeros."""
        if self.wheel.driver is not None:
            self.wheel.leave(self.wheel.driver)

    def estop(self, who: str) -> None:
        """Stop the robot; asked again until safety has latched it."""
        self.wheel.lapse()
        self._requests.stop()
        self.bus.estop()
        self._estops = ESTOP_TICKS
        self._log.warning("emergency stop", asked_by=who)

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

    def _creep(self, held: bool) -> None:
        """Ask again while held, one call at a time; say at once when it ends."""
        if held and not self._creep_pending:
            self._creep_pending = self._creeping = True
            self._ask_release(True)
        elif not held and self._creeping:
            self._creeping, self._creep_answer = False, ""
            self._ask_release(False)

    def _ask_release(self, held: bool) -> None:
        self.bus.ask(
            keys.RELEASE,
            m.ReleaseRequest(held=held),
            lambda done: self._creep_answered("info", done.text),
            lambda reason: self._creep_answered("warning", reason),
            timeout_s=CREEP_TIMEOUT_S,
        )

    def _creep_answered(self, level: m.Level, text: str) -> None:
        self._creep_pending = False
        driver = self.wheel.driver
        if self._creeping and driver is not None and text != self._creep_answer:
            self._creep_answer = text
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
