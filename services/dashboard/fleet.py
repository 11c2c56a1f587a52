"""All robots and their viewers; in the node's loop.

The web server runs in another thread. It posts the viewers' messages to this loop and receives what
they are to show. A snapshot is encoded once and sent to all viewers of its robot.
"""

import re
import secrets
import threading
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial

import msgspec

from common import clock, keys
from common.bus.bus import Bus
from common.freshness import NS_PER_S
from common.messages import Level, SafetyState
from common.service import Node
from services.dashboard import client_messages as client
from services.dashboard.client_messages import ROBOT
from services.dashboard.config import DashboardConfig
from services.dashboard.driver_lock import Push
from services.dashboard.robot import Robot
from services.dashboard.snapshot import fast_snapshot, slow_snapshot

PERIOD_S = 0.05
SLOW_TICKS = 10  # between two slow snapshots
IDLE_S = 30.0  # after which a robot without viewers is closed
KNOWN_MAX = 100  # robots; beyond these, one that leaves is forgotten
ROBOTS_MAX = 16  # open at the same time; each has a session of its own

# Takes the viewers, the text, and whether it replaces an older one that still waits.
Send = Callable[[Collection[str], bytes, bool], None]


@dataclass
class Viewer:
    """One browser."""

    name: str
    robot: str
    events_sent: int = -1  # the robot's event count when they were last sent; -1: none were
    has_trail: bool = False


class Fleet:
    """Handles the viewers' messages and sends their snapshots."""

    def __init__(self, node: Node[DashboardConfig], send: Send) -> None:
        self._node = node
        self._settings = node.config.dashboard
        self._vehicle = node.config.vehicle
        self._send_text = send
        self._viewers: dict[str, Viewer] = {}
        self._robots: dict[str, Robot] = {}
        self._alive: dict[str, set[str]] = {node.config.robot.id: set()}
        # Random start: a message to an earlier dashboard matches no snapshot of this one.
        self._number = secrets.randbits(31)
        self._joined = 0
        self._leaving = False
        node.bus.watch_live(keys.live_key("*", "*", "*"), self._note_alive)
        node.loop.every(PERIOD_S, self.tick)

    # --- called by the server, posted -----------------------------------------------------------

    def join(self, viewer: str) -> None:
        """Add a browser; it shows the robot of the settings until it selects another one."""
        self._joined += 1
        self._viewers[viewer] = Viewer(f"{self._joined}", self._node.config.robot.id)

    def leave(self, viewer: str) -> None:
        """Remove a browser and free its driver lock."""
        gone = self._viewers.pop(viewer, None)
        if gone and gone.robot in self._robots:
            self._robots[gone.robot].driver_lock.leave(viewer)
            self._robots[gone.robot].keepalive.left(viewer)

    def handle(self, viewer: str, message: client.AnyMessage) -> None:
        """Handle a viewer's message."""
        if viewer not in self._viewers or self._leaving:
            return
        if isinstance(message, client.Look):
            self._select(viewer, message)
            return
        if isinstance(message, client.Estop):
            self._estop(viewer, message.robot or self._viewers[viewer].robot)
            return
        robot = self._robot_of(viewer)
        if isinstance(message, client.Alive):
            robot.keep_alive(viewer, message.n, clock.now_ns())
        elif isinstance(message, client.Take):
            self._take(viewer, robot, message.force)
        elif robot.driver_lock.driver == viewer:
            self._drive(viewer, robot, message)
        elif not isinstance(message, client.Hold | client.Free | client.Leave):
            self._notify(viewer, "warning", "take_first")

    def estop(self, robot: str, requested_by: str) -> None:
        """Stop a robot that ``knows`` accepts; needs no viewer."""
        if robot == self._node.config.robot.id:
            self._node.bus.estop()  # at once: this session is always open
        self._open(robot).estop(requested_by)

    # --- called by the server in its own thread -------------------------------------------------

    def knows(self, robot: str) -> bool:
        """Return whether the robot is in the settings, was alive, or has viewers."""
        return robot in self._alive or robot in self._robots

    # --- the loop -------------------------------------------------------------------------------

    def tick(self, now_ns: int) -> None:
        """Send the requests of all robots and the snapshots to all viewers."""
        self._number += 1
        for robot in self._robots.values():
            robot.tick(now_ns)
        if self._leaving:
            if all(robot.silent for robot in self._robots.values()):
                self._node.loop.stop()
            return
        for name in {viewer.robot for viewer in self._viewers.values()}:
            self._send_snapshots(name, self._open(name), now_ns)
        for name, robot in list(self._robots.items()):
            if now_ns - robot.used_ns > IDLE_S * NS_PER_S and robot.silent:
                self._close(name, robot)

    def _send_snapshots(self, name: str, robot: Robot, now_ns: int) -> None:
        here = {key: viewer for key, viewer in self._viewers.items() if viewer.robot == name}
        names = {key: viewer.name for key, viewer in here.items()}
        fast = fast_snapshot(
            robot.telemetry,
            robot.driver_state(names),
            now_ns,
            number=self._number,
            connected=robot.bus.connected,
            vehicle=self._vehicle,
            protection=robot.protection,
            keeper=robot.keepalive.holder,
        )
        state = robot.telemetry.newest(keys.SAFETY, now_ns)
        robot.driver_lock.sent(self._number, now_ns, state)
        robot.used_ns = now_ns
        self._send(here, fast, replaces=True)
        if self._number % SLOW_TICKS == 0:
            robot.telemetry.update_rates(now_ns)
            robots = sorted({*self._alive, *self._robots})
            alive = {each: bool(self._alive.get(each)) for each in robots}
            slow = slow_snapshot(robot.telemetry, alive, names, robot.protection, now_ns)
            self._send(here, slow, replaces=True)
        if not robot.trail_sent:
            robot.trail_sent = True
            self._send_trail(here, robot)
        if self._number % SLOW_TICKS == 1:
            self._send_events(here, robot)

    def _send_events(self, here: dict[str, Viewer], robot: Robot) -> None:
        count = robot.telemetry.event_count
        for sent in {viewer.events_sent for viewer in here.values()} - {count}:
            lines = [line for line in robot.telemetry.events if line.n > sent]
            late = [key for key, viewer in here.items() if viewer.events_sent == sent]
            self._send(late, {"k": "events", "lines": lines, "all": sent < 0})
            for key in late:
                here[key].events_sent = count

    def end(self) -> None:
        """Free all driver locks; the loop stops after the final zeros."""
        self._leaving = True
        for robot in self._robots.values():
            robot.release_driver()

    def close(self) -> None:
        """Close every robot's session."""
        for robot in self._robots.values():
            robot.bus.close()

    # --- viewers --------------------------------------------------------------------------------

    def _select(self, viewer: str, message: client.Look) -> None:
        one = self._viewers[viewer]
        if message.robot not in self._robots and len(self._robots) >= ROBOTS_MAX:
            self._notify(viewer, "warning", "too_many_robots")
        elif one.robot != message.robot:
            self._robot_of(viewer).driver_lock.leave(viewer)
            self._robot_of(viewer).keepalive.left(viewer)
            one.robot, one.has_trail = message.robot, False
        one.name = message.name.strip() or one.name
        robot = self._robot_of(viewer)
        hello = {
            "k": "hello",
            "id": viewer,
            "name": one.name,
            "robot": one.robot,
            "vehicle": self._vehicle,
            "gears": self._settings.gears_linear,
            "keepalive": bool(self._settings.estop_keepalive),
        }
        self._send([viewer], hello)
        if not one.has_trail:  # a new name alone restores no trail that the viewer has cleared
            one.has_trail, one.events_sent = True, -1
            self._send_trail([viewer], robot)

    def _take(self, viewer: str, robot: Robot, force: bool) -> None:
        before = robot.driver_lock.driver
        if not robot.may_drive:
            self._notify(viewer, "error", "barred")
        elif not robot.driver_lock.take(viewer, force):
            name = self._viewers[before].name if before in self._viewers else ""
            self._send([viewer], {"k": "taken", "by": name})
        elif before not in (None, viewer):
            self._notify(str(before), "warning", "taken_over")

    def _estop(self, viewer: str, robot: str) -> None:
        if self.knows(robot):
            self.estop(robot, self._viewers[viewer].name)
        else:
            self._notify(viewer, "error", "estop_unknown")

    def _drive(self, viewer: str, robot: Robot, message: client.AnyMessage) -> None:
        lock = robot.driver_lock
        match message:
            case client.Hold(n, x, y, release):
                lock.hold(viewer, n, Push(x, y, release), clock.now_ns())
            case client.Free():
                lock.let_go(viewer)
            case client.Leave():
                lock.leave(viewer)
            case client.Gear(gear):
                lock.shift(viewer, gear)
            case _:
                self._call(viewer, robot, message)

    def _call(self, viewer: str, robot: Robot, message: client.AnyMessage) -> None:
        notify = partial(self._notify, viewer)
        match message:
            case client.Reset(n):
                if seen := self._seen(viewer, robot, n):
                    robot.reset(seen, notify)
            case client.Switch(to, n):
                if seen := self._seen(viewer, robot, n):
                    robot.switch(seen, to, notify)
            case client.Lamp(to):
                robot.call(keys.SET_LED, to, notify)

    def _seen(self, viewer: str, robot: Robot, number: int) -> SafetyState | None:
        """Return the state of safety that the viewer saw; refuse a late command with a notice."""
        limit_s = self._settings.call_round_trip
        seen = robot.driver_lock.seen(number, clock.now_ns(), limit_s)
        if seen is None:
            self._notify(viewer, "warning", "too_late")
        return seen

    def _notify(self, viewer: str, level: Level, text: str, about: str = "") -> None:
        """Send a text or its key in ``i18n``, and the key of the result that it explains."""
        notice = {"k": "notice", "level": level, "text": text, "about": about}
        self._send([viewer], notice)

    def _broadcast(self, robot: str, level: Level, text: str, about: str = "") -> None:
        for key, viewer in self._viewers.items():
            if viewer.robot == robot:
                self._notify(key, level, text, about)

    def _send_trail(self, viewers: Collection[str], robot: Robot) -> None:
        self._send(viewers, {"k": "path", "points": list(robot.trail.points)})

    def _send(self, viewers: Collection[str], message: object, replaces: bool = False) -> None:
        if viewers:
            self._send_text(list(viewers), msgspec.json.encode(message), replaces)

    # --- robots ---------------------------------------------------------------------------------

    def _robot_of(self, viewer: str) -> Robot:
        return self._open(self._viewers[viewer].robot)

    def _open(self, name: str) -> Robot:
        if name not in self._robots:
            node = self._node
            bus = Bus(node.config.bus, name, node.loop.post)
            broadcast = partial(self._broadcast, name)
            self._robots[name] = Robot(bus, self._settings, broadcast)
            bus.open()
        self._robots[name].used_ns = clock.now_ns()
        return self._robots[name]

    def _close(self, name: str, robot: Robot) -> None:
        if not robot.bus.connected:
            return  # its session may be opening at this moment; without a router it costs nothing
        del self._robots[name]
        # In a thread: closing a session takes time while other robots are being driven.
        threading.Thread(target=robot.bus.close, name=f"close {name}").start()

    def _note_alive(self, key: str, alive: bool) -> None:
        robot = key.split("/")[2]
        if not re.match(ROBOT, robot):
            return  # no viewer could select it
        tokens = self._alive.setdefault(robot, set())
        (tokens.add if alive else tokens.discard)(key)
        if not tokens and len(self._alive) > KNOWN_MAX and robot != self._node.config.robot.id:
            del self._alive[robot]
