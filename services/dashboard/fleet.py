"""The robots that are there and the viewers that look at them; everything in the node's loop.

The web server lives in another thread. It posts what its viewers say, and takes what they are to
see: a picture is encoded once and goes to all who look at that robot.
"""

import re
import secrets
import threading
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial

import msgspec

from common import keys
from common.bus.bus import Bus
from common.freshness import NS_PER_S
from common.messages import Level, SafetyState
from common.service import Node
from services.dashboard import client_messages as w
from services.dashboard import snapshot
from services.dashboard.client_messages import ROBOT
from services.dashboard.config import DashboardConfig
from services.dashboard.driver_lock import Push
from services.dashboard.robot import Robot

PERIOD_S = 0.05
REST_TICKS = 10  # between two pictures of what stands still
UNWANTED_S = 30.0  # after which a robot that nobody looks at is let go
ROBOTS_MAX = 16  # that may be looked at; each has a session of its own

# Takes the viewers, the text, and whether a newer one may take its place while it waits.
Show = Callable[[Collection[str], bytes, bool], None]


@dataclass
class Viewer:
    """One browser."""

    name: str
    robot: str
    told: int = -1  # events of that robot which it has been shown
    greeted: bool = False  # whether it has been shown where that robot was


class Fleet:
    """Takes in what viewers say and draws their pictures."""

    def __init__(self, node: Node[DashboardConfig], show: Show) -> None:
        self._node = node
        self._settings = node.config.dashboard
        self._vehicle = node.config.vehicle
        self._show = show
        self._viewers: dict[str, Viewer] = {}
        self._robots: dict[str, Robot] = {}
        self._alive: dict[str, set[str]] = {node.config.robot.id: set()}
        # Random start: a message to an earlier dashboard matches no picture of this one.
        self._number = secrets.randbits(31)
        self._newcomers = 0
        self._leaving = False
        node.bus.watch_live(keys.live_key("*", "*", "*"), self._note_alive)
        node.loop.every(PERIOD_S, self.tick)

    # --- what the server calls, posted ----------------------------------------------------------

    def join(self, viewer: str) -> None:
        """Take a browser in; it looks at the settings' robot until it says otherwise."""
        self._newcomers += 1
        self._viewers[viewer] = Viewer(f"{self._newcomers}", self._node.config.robot.id)

    def leave(self, viewer: str) -> None:
        """Let a browser go, and the wheel that it has."""
        gone = self._viewers.pop(viewer, None)
        if gone and gone.robot in self._robots:
            self._robots[gone.robot].wheel.leave(viewer)

    def take_in(self, viewer: str, word: w.AnyWord) -> None:
        """Do what a viewer says."""
        if viewer not in self._viewers or self._leaving:
            return
        if isinstance(word, w.Look):
            self._look(viewer, word)
            return
        if isinstance(word, w.Estop):
            self._estop(viewer, word.robot or self._viewers[viewer].robot)
            return
        robot = self._robot_of(viewer)
        if isinstance(word, w.Take):
            self._take(viewer, robot, word.force)
        elif robot.wheel.driver == viewer:
            self._drive(viewer, robot, word)
        elif not isinstance(word, w.Hold | w.Free | w.Leave):
            self._tell(viewer, "warning", "take_first")

    def estop(self, robot: str, who: str) -> None:
        """Stop a robot that ``knows`` accepts; needs no viewer's connection."""
        if robot == self._node.config.robot.id:
            self._node.bus.estop()  # at once: this session is always open
        self._open(robot).estop(who)

    # --- what the server asks, from its own thread ----------------------------------------------

    def knows(self, robot: str) -> bool:
        """Return whether it is the settings' robot, was seen alive, or is looked at."""
        return robot in self._alive or robot in self._robots

    # --- the loop -------------------------------------------------------------------------------

    def tick(self, now_ns: int) -> None:
        """Draw what is looked at, and let every robot ask what is due."""
        self._number += 1
        for robot in self._robots.values():
            robot.tick(now_ns)
        if self._leaving:
            if all(robot.silent for robot in self._robots.values()):
                self._node.loop.stop()
            return
        for name in {viewer.robot for viewer in self._viewers.values()}:
            self._draw(name, self._open(name), now_ns)
        for name, robot in list(self._robots.items()):
            if now_ns - robot.wanted_ns > UNWANTED_S * NS_PER_S and robot.silent:
                self._forget(name, robot)

    def _draw(self, name: str, robot: Robot, now_ns: int) -> None:
        here = {key: viewer for key, viewer in self._viewers.items() if viewer.robot == name}
        names = {key: viewer.name for key, viewer in here.items()}
        moving = snapshot.now(
            robot.heard,
            robot.wheel,
            now_ns,
            number=self._number,
            names=names,
            connected=robot.bus.connected,
            vehicle=self._vehicle,
            protection=robot.protection,
        )
        robot.wheel.sent(self._number, now_ns)
        robot.snapshots.sent(self._number, robot.heard.newest(keys.SAFETY, now_ns), now_ns)
        robot.wanted_ns = now_ns
        self._send(here, moving, newer_wins=True)
        if self._number % REST_TICKS == 0:
            robot.heard.count(now_ns)
            robots = sorted({*self._alive, *self._robots})
            alive = {each: bool(self._alive.get(each)) for each in robots}
            still = snapshot.rest(robot.heard, alive, names, robot.protection, now_ns)
            self._send(here, still, newer_wins=True)
        if not robot.said_path:
            robot.said_path = True
            self._send_path(here, robot)
        late = [key for key, viewer in here.items() if viewer.told != robot.heard.told]
        if late and self._number % REST_TICKS == 1:
            self._send(late, {"k": "events", "lines": snapshot.told(robot.heard)})
            for key in late:
                here[key].told = robot.heard.told

    def end(self) -> None:
        """Let every wheel go; the loop stops after the last zeros."""
        self._leaving = True
        for robot in self._robots.values():
            robot.rest()

    def close(self) -> None:
        """End every robot's session."""
        for robot in self._robots.values():
            robot.bus.close()

    # --- viewers --------------------------------------------------------------------------------

    def _look(self, viewer: str, word: w.Look) -> None:
        one = self._viewers[viewer]
        if word.robot not in self._robots and len(self._robots) >= ROBOTS_MAX:
            self._tell(viewer, "warning", "too_many_robots")
        elif one.robot != word.robot:
            self._robot_of(viewer).wheel.leave(viewer)
            one.robot, one.greeted = word.robot, False
        one.name = word.name.strip() or one.name
        robot = self._robot_of(viewer)
        hello = {
            "k": "hello",
            "id": viewer,
            "name": one.name,
            "robot": one.robot,
            "vehicle": self._vehicle,
            "gears": self._settings.gears_linear,
        }
        self._send([viewer], hello)
        if not one.greeted:  # a new name alone brings back no trail that was cleared
            one.greeted, one.told = True, -1
            self._send_path([viewer], robot)

    def _take(self, viewer: str, robot: Robot, force: bool) -> None:
        before = robot.wheel.driver
        if not robot.wheel.take(viewer, force):
            who = self._viewers[before].name if before in self._viewers else ""
            self._send([viewer], {"k": "ask", "who": who})
        elif before not in (None, viewer):
            self._tell(str(before), "warning", "taken_over")

    def _estop(self, viewer: str, robot: str) -> None:
        if self.knows(robot):
            self.estop(robot, self._viewers[viewer].name)
        else:
            self._tell(viewer, "error", "estop_unknown")

    def _drive(self, viewer: str, robot: Robot, word: w.AnyWord) -> None:
        wheel = robot.wheel
        match word:
            case w.Hold(n, x, y, release):
                wheel.hold(viewer, n, Push(x, y, release), time.monotonic_ns())
            case w.Free():
                wheel.let_go(viewer)
            case w.Leave():
                wheel.leave(viewer)
            case w.Gear(gear):
                wheel.shift(viewer, gear)
            case _:
                self._call(viewer, robot, word)

    def _call(self, viewer: str, robot: Robot, word: w.AnyWord) -> None:
        tell = partial(self._tell, viewer)
        match word:
            case w.Reset(n):
                if seen := self._seen(viewer, robot, n):
                    robot.reset(seen, tell)
            case w.Switch(to, n):
                if seen := self._seen(viewer, robot, n):
                    robot.switch(seen, to, tell)
            case w.Lamp(to):
                robot.call(keys.SET_LED, to, tell)

    def _seen(self, viewer: str, robot: Robot, number: int) -> SafetyState | None:
        """Return what the viewer saw of safety; refuse a late command, with a message."""
        limit_s = self._settings.call_round_trip
        seen = robot.snapshots.seen(number, time.monotonic_ns(), limit_s)
        if seen is None:
            self._tell(viewer, "warning", "too_late")
        return seen

    def _tell(self, viewer: str, level: Level, text: str) -> None:
        self._send([viewer], {"k": "told", "level": level, "text": text})

    def _broadcast(self, robot: str, level: Level, text: str) -> None:
        here = [key for key, viewer in self._viewers.items() if viewer.robot == robot]
        self._send(here, {"k": "told", "level": level, "text": text})

    def _send_path(self, viewers: Collection[str], robot: Robot) -> None:
        self._send(viewers, {"k": "path", "points": list(robot.trail.points)})

    def _send(self, viewers: Collection[str], what: object, newer_wins: bool = False) -> None:
        if viewers:
            self._show(list(viewers), msgspec.json.encode(what), newer_wins)

    # --- robots ---------------------------------------------------------------------------------

    def _robot_of(self, viewer: str) -> Robot:
        return self._open(self._viewers[viewer].robot)

    def _open(self, name: str) -> Robot:
        if name not in self._robots:
            node = self._node
            bus = Bus(node.config.bus, name, node.loop.post)
            broadcast = partial(self._broadcast, name)
            self._robots[name] = Robot(bus, self._settings, broadcast, self._tell)
            bus.open()
        self._robots[name].wanted_ns = time.monotonic_ns()
        return self._robots[name]

    def _forget(self, name: str, robot: Robot) -> None:
        if not robot.bus.connected:
            return  # it may be given its session this moment; no router, no harm
        del self._robots[name]
        # Aside: to end a session takes its time, and others are being driven.
        threading.Thread(target=robot.bus.close, name=f"close {name}").start()

    def _note_alive(self, key: str, alive: bool) -> None:
        robot = key.split("/")[2]
        if not re.match(ROBOT, robot):
            return  # no viewer could ask for it
        tokens = self._alive.setdefault(robot, set())
        (tokens.add if alive else tokens.discard)(key)
