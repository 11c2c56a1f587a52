"""The page of one robot: its viewers, their messages, and the snapshots that they are shown.

A snapshot is encoded once and sent to all viewers.
"""

from collections.abc import Callable, Collection, Mapping
from functools import partial

import msgspec

from common import clock
from common.bus.bus import Bus
from common.freshness import NS_PER_S
from common.heartbeat import MAX_CALL_AGE_NS
from services.dashboard import client_messages as client
from services.dashboard.config import DashboardConfig
from services.dashboard.driver_lock import HOLD_S, Push
from services.dashboard.i18n import Texts, label, phrase
from services.dashboard.pictures import Pictures
from services.dashboard.robot import Robot
from services.dashboard.snapshot import fast_snapshot, slow_snapshot
from t2.messages import EventName, Level

SIGHT: dict[bool, tuple[EventName, Level]] = {
    True: ("in_sight", "warning"),
    False: ("by_picture", "info"),
}
SLOW_TICKS = 10  # between two slow snapshots

# Takes the viewers, the text, and whether it replaces an older one that still waits.
Send = Callable[[Collection[str], bytes, bool], None]


def notice(level: Level, text: Texts) -> bytes:
    """Return a message with a text for a viewer."""
    return msgspec.json.encode({"k": "notice", "level": level, "text": text})


class RobotPage:
    """One robot, and the browsers that show it."""

    def __init__(self, bus: Bus, config: DashboardConfig, send: Send) -> None:
        self.robot = Robot(bus, config, self._broadcast)
        self.viewers: set[str] = set()
        self.used_ns = 0  # the last time that it had a viewer, or was stopped
        self._config = config
        self._send_text = send
        self.pictures = Pictures(
            bus, self.robot.telemetry, lambda viewers, text: self._send_text(viewers, text, True)
        )
        self._ticks = 0

    def join(self, viewer: str) -> None:
        """Add a browser; it gets all events, and later new ones."""
        dashboard = self._config.dashboard
        self._send_events()
        self.viewers.add(viewer)
        hello = {
            "k": "hello",
            "id": viewer,
            "vehicle": self._config.vehicle,
            "gears": self._config.vehicle.gears_linear,
            "hold_s": HOLD_S,
            "call_s": MAX_CALL_AGE_NS / NS_PER_S,
            "keepalive": bool(dashboard.estop_keepalive),
            "floor_plan": [dashboard.floor_plan_first, dashboard.floor_plan_second],
        }
        self._send([viewer], hello)
        self._send([viewer], {"k": "events", "lines": self.robot.telemetry.events, "all": True})

    def leave(self, viewer: str) -> None:
        """Remove a browser and free its driver lock."""
        self.viewers.discard(viewer)
        self._give_up(viewer)
        self.robot.keepalive.left(viewer)
        self.pictures.leave(viewer)

    def handle(self, viewer: str, message: client.AnyMessage) -> None:
        """Handle a viewer's message."""
        match message:
            case client.Alive():
                self._alive(viewer, message)
            case client.Take():
                self._take(viewer, message)
            case client.Watch(camera):
                self.pictures.watch(viewer, camera, clock.now_ns())
            case client.Routes(route):
                self.robot.routes.ask(route, partial(self._send_route, viewer))
            case _ if self.robot.driver_lock.driver == viewer:
                self._drive(viewer, message)
            case client.Gear() | client.Reset() | client.Round() | client.Teach():
                self._notify(viewer, "warning", label("take_first"))

    def tick(self, now_ns: int, robots: Mapping[str, bool]) -> None:
        """Send the requests of the robot's driver, and the snapshots."""
        self.robot.tick(now_ns)
        if not self.viewers:
            return
        self.used_ns, self._ticks = now_ns, self._ticks + 1
        self.pictures.tick()
        robot = self.robot
        fast = fast_snapshot(
            robot.telemetry,
            robot.driver_state(),
            now_ns,
            connected=robot.bus.connected,
            keeper=robot.keepalive.holder,
        )
        self._send(self.viewers, fast, replaces=True)
        if self._ticks % SLOW_TICKS == 0:
            slow = slow_snapshot(
                robot.telemetry, robots, len(self.viewers), now_ns,
                routes=robot.routes.version, cameras=self.pictures.views(now_ns),
            )  # fmt: skip
            self._send(self.viewers, slow, replaces=True)
        if self._ticks % SLOW_TICKS == 1:
            self._send_events()

    def _alive(self, viewer: str, message: client.Alive) -> None:
        """Answer with the age of the state that the page answers: the delay of its link."""
        now_ns = clock.now_ns()
        self.robot.keep_alive(viewer, message.echo, now_ns)
        shown = self.robot.telemetry.shown(message.echo)
        age_s = shown.age_s(now_ns) if shown else None
        self._send([viewer], {"k": "alive", "at": message.at, "age": age_s})

    def _take(self, viewer: str, message: client.Take) -> None:
        lock = self.robot.driver_lock
        before, other = lock.driver, lock.name or f"viewer {lock.driver}"
        who = message.name or f"viewer {viewer}"
        if not self.robot.may_drive:
            self._notify(viewer, "error", phrase("event.barred"))
        elif not lock.take(viewer, message.force, message.name):
            self._send([viewer], {"k": "taken"})
        elif before is None:
            self.robot.event("take", "info", by=who)
        elif before != viewer:
            self._notify(str(before), "warning", phrase("driver.taken", who=who))
            self.robot.event("take_over", "info", by=who, other=other)

    def _give_up(self, viewer: str) -> None:
        """Free the driver lock if this viewer has it."""
        lock = self.robot.driver_lock
        if lock.driver == viewer:
            lock.leave(viewer)
            self.robot.event("leave", "info", by=lock.name or f"viewer {viewer}")

    def _drive(self, viewer: str, message: client.AnyMessage) -> None:
        robot, lock, notify = self.robot, self.robot.driver_lock, partial(self._notify, viewer)
        match message:
            case client.Hold(echo, x, y, release):
                by_picture = self.pictures.has_camera and not lock.in_sight
                is_valid = not by_picture or self.pictures.has_sent(viewer, echo)
                shown = robot.telemetry.shown(echo) if is_valid else None
                lock.hold(Push(x, y, release), shown, clock.now_ns())
            case client.Sight(in_sight, name=name):
                self._set_sight(in_sight, name or f"viewer {viewer}")
            case client.Free():
                lock.let_go()
            case client.Leave():
                self._give_up(viewer)
            case client.Gear(gear):
                lock.gear = gear
            case client.Reset(echo, name=name):
                robot.reset(echo, name or f"viewer {viewer}", notify)
            case client.Round() | client.Teach():
                robot.patrol(message, message.name or f"viewer {viewer}", notify)

    def _set_sight(self, in_sight: bool, by: str) -> None:
        lock = self.robot.driver_lock
        if in_sight != lock.in_sight:
            lock.in_sight = in_sight
            lock.lapse()  # what is held now was pressed in the other mode
            name, level = SIGHT[in_sight]
            self.robot.event(name, level, by=by)

    def _send_route(self, viewer: str, message: bytes) -> None:
        self._send_text([viewer], message, False)

    def _notify(self, viewer: str, level: Level, text: Texts) -> None:
        self._send_text([viewer], notice(level, text), False)

    def _broadcast(self, level: Level, text: Texts) -> None:
        for viewer in self.viewers:
            self._notify(viewer, level, text)

    def _send_events(self) -> None:
        lines, are_all = self.robot.telemetry.take_new()
        if lines:
            self._send(self.viewers, {"k": "events", "lines": lines, "all": are_all})

    def _send(self, viewers: Collection[str], message: object, replaces: bool = False) -> None:
        self._send_text(list(viewers), msgspec.json.encode(message), replaces)
