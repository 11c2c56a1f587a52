"""The robots of the router, and the page of each one that is shown; in the node's loop.

The web server runs in another thread. It posts the viewers' messages to this loop and receives what
they are to show.
"""

import re
import threading

from common import clock
from common.bus.bus import Bus
from common.freshness import NS_PER_S
from common.service import Node
from services.dashboard import client_messages as client
from services.dashboard import shift_log
from services.dashboard.client_messages import ROBOT
from services.dashboard.config import DashboardConfig
from services.dashboard.i18n import label
from services.dashboard.patrol import SendText
from services.dashboard.robot_page import RobotPage, Send, notice
from t2 import keys
from t2.messages import LogRequest, Phrase
from t2.words import refusal

PERIOD_S = 0.05
IDLE_S = 30.0  # after which the page of a robot without viewers is closed
KNOWN_MAX = 100  # robots; beyond these, one that leaves is forgotten
PAGES_MAX = 16  # robots that are shown at the same time; each has a session of its own


class Fleet:
    """The pages of all robots that are shown, by robot."""

    def __init__(self, node: Node[DashboardConfig]) -> None:
        self.send: Send = lambda _viewers, _text, _replaces: None  # set by the web server
        self._node = node
        self._pages: dict[str, RobotPage] = {}
        self._alive: dict[str, set[str]] = {node.config.robot.id: set()}  # tokens by robot
        self._leaving = False
        node.bus.watch_live(keys.live_key("*", "*", "*"), self._note_alive)
        node.loop.every(PERIOD_S, self.tick)

    # --- called by the server, posted -----------------------------------------------------------

    def join(self, robot: str, viewer: str) -> None:
        """Add a browser to the page of a robot."""
        if robot in self._pages or len(self._pages) < PAGES_MAX:
            self._open(robot).join(viewer)
        else:
            self.send([viewer], notice("warning", label("too_many_robots")), False)

    def leave(self, robot: str, viewer: str) -> None:
        """Remove a browser and free its driver lock."""
        if page := self._pages.get(robot):
            page.leave(viewer)

    def handle(self, robot: str, viewer: str, message: client.AnyMessage) -> None:
        """Handle a viewer's message."""
        page = self._pages.get(robot)
        if page and viewer in page.viewers and not self._leaving:
            page.handle(viewer, message)

    def estop(self, robot: str, requested_by: str, age_s: float = 0.0) -> None:
        """Stop a robot that ``knows`` accepts; needs no viewer."""
        if robot == self._node.config.robot.id:
            self._node.bus.estop()  # at once: this session is always open
        self._open(robot).robot.estop(requested_by, age_s)

    def log(self, robot: str, before_ns: int | None, send: SendText) -> None:
        """Read rows of the shift log of a robot that ``knows`` accepts; needs no viewer."""
        if robot == self._node.config.robot.id:
            bus = self._node.bus  # always open
        elif robot in self._pages or len(self._pages) < PAGES_MAX:
            bus = self._open(robot).robot.bus
        else:
            send(shift_log.problem(refusal(Phrase("log.busy"))))
            return
        bus.call(
            keys.LOG,
            LogRequest(since_ns=1, before_ns=before_ns, most=shift_log.ROWS),
            lambda reply: send(shift_log.log_view(reply)),
            lambda refused: send(shift_log.problem(refused)),
            shift_log.CALL_S,
        )

    # --- called by the server in its own thread -------------------------------------------------

    def knows(self, robot: str) -> bool:
        """Return whether the robot is in the settings, was alive, or is shown."""
        return robot in self._alive or robot in self._pages

    # --- the loop -------------------------------------------------------------------------------

    def tick(self, now_ns: int) -> None:
        """Send the requests of all robots and the snapshots to all viewers."""
        robots = {name: bool(self._alive.get(name)) for name in {*self._alive, *self._pages}}
        for page in self._pages.values():
            page.tick(now_ns, robots)
        is_silent = all(page.robot.silent for page in self._pages.values())
        if self._leaving and is_silent:
            self._node.loop.stop()
        for name, page in list(self._pages.items()):
            if now_ns - page.used_ns > IDLE_S * NS_PER_S and page.robot.silent:
                self._close(name, page)

    def end(self) -> None:
        """Free all driver locks; the loop stops after the final zeros."""
        self._leaving = True
        for page in self._pages.values():
            page.robot.free_driver()

    def close(self) -> None:
        """Close every robot's session."""
        for page in self._pages.values():
            page.robot.bus.close()

    # --- robots ---------------------------------------------------------------------------------

    def _open(self, name: str) -> RobotPage:
        if name not in self._pages:
            bus = Bus(self._node.config.bus, name, self._node.loop.post)
            self._pages[name] = RobotPage(bus, self._node.config, lambda *sent: self.send(*sent))
            bus.open()
        self._pages[name].used_ns = clock.now_ns()
        return self._pages[name]

    def _close(self, name: str, page: RobotPage) -> None:
        if not page.robot.bus.connected:
            return  # its session may be opening at this moment; without a router it costs nothing
        del self._pages[name]
        # In a thread: closing a session takes time while other robots are being driven.
        threading.Thread(target=page.robot.bus.close, name=f"close {name}").start()

    def _note_alive(self, key: str, alive: bool) -> None:
        robot, _, service = key.split("/")[2:5]
        if service not in keys.ON_BOARD or not re.match(ROBOT, robot):
            return  # a laptop's service, or a robot that can have no page
        tokens = self._alive.setdefault(robot, set())
        (tokens.add if alive else tokens.discard)(key)
        if not tokens and len(self._alive) > KNOWN_MAX and robot != self._node.config.robot.id:
            del self._alive[robot]
