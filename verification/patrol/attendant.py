"""A person beside the vehicle: places it, starts the round, resets what is latched, resumes."""

import random
from collections.abc import Callable

from common.freshness import NS_PER_S
from t2 import keys
from verification.localization.source import place_request
from verification.patrol.draw import NAME
from verification.patrol.judge import Judge
from verification.patrol.robot import Robot
from verification.search.bus import MS

PLACED_SIGMA = 0.05  # m and rad, of a placement
READY_NS = 2 * NS_PER_S
LOOK_NS, AGAIN_NS = 1500 * MS, NS_PER_S  # from a stop to the first call; between two calls
STARTS, RESETS, PLACEMENTS = 30, 60, 40  # calls at most
RESUMES, REFUSALS = 15, 60  # accepted and refused calls at most
UNCERTAIN = ("patrol.uncertain", "patrol.outside", "map.uncertain", "map.contradicted")


class Attendant:
    """Acts ten times a second; ``gave_up`` is why the round does not go on."""

    def __init__(self, robot: Robot, judge: Judge, chance: random.Random, *, places: bool) -> None:
        self.gave_up = ""
        self.is_started = False
        self.actions: list[str] = []  # what was resumed, and why
        self._robot, self._judge, self._random = robot, judge, chance
        self._places = places  # whether it places a vehicle that lost its position
        self._left = {
            "start": STARTS, "reset": RESETS, "place": PLACEMENTS,
            "resume": RESUMES, "refused": REFUSALS,
        }  # fmt: skip
        self._is_placed = False
        self._stands_ns: int | None = None  # since when the round needs a person
        self._next_ns = robot.net.now_ns + READY_NS

    def act(self) -> None:
        """Do what is due."""
        now_ns = self._robot.net.now_ns
        if now_ns < self._next_ns or self.gave_up or self._robot.seen is None:
            return
        if self._robot.seen.latched:
            self._wait_and(self._reset)
        elif not self._is_placed:
            self._place()
        elif not self.is_started:
            self._start()
        elif (state := self._judge.state) and state.state in {"stopped", "paused"}:
            self._wait_and(self._go_on)
        else:
            self._stands_ns = None

    def _wait_and(self, call: Callable[[], None]) -> None:
        now_ns = self._robot.net.now_ns
        self._stands_ns = self._stands_ns or now_ns
        if now_ns - self._stands_ns >= LOOK_NS:
            self._next_ns = now_ns + AGAIN_NS
            call()

    def _counts(self, what: str) -> bool:
        """Count a call; return whether there is one left."""
        self._left[what] -= 1
        if self._left[what] < 0:
            self.gave_up = self.gave_up or f"too many calls: {what}"
        return self._left[what] >= 0

    def _reset(self) -> None:
        if self._counts("reset"):
            self._robot.reset()

    def _place(self) -> None:
        if self._counts("place"):
            request = place_request(self._robot, self._random, PLACED_SIGMA)
            self._is_placed = bool(self._robot.ask("localization", keys.PLACE, request).done)
            self._next_ns = self._robot.net.now_ns + 200 * MS

    def _start(self) -> None:
        if self._counts("start"):
            answer = self._robot.act("start", NAME)
            self.is_started = bool(answer.done)
            self._next_ns = self._robot.net.now_ns + AGAIN_NS
            if self.is_started:
                self._judge.resumed()
            else:
                self.actions.append(f"not started: {answer.text}")

    def _go_on(self) -> None:
        state, pose = self._judge.state, self._judge.pose
        assert state is not None
        why = state.phrases[0].name if state.phrases else ""
        if not self._places and why in UNCERTAIN:
            self.gave_up = why
        elif pose is not None and pose.state != "placed":
            self._is_placed = False
        elif self._counts("refused"):
            answer = self._robot.act("resume")
            if answer.done:
                self._judge.resumed()
                self._left["refused"] = REFUSALS
                self.actions.append(f"resumed after: {why}")
                self._counts("resume")
            else:
                self.actions.append(f"refused after {why}: {answer.text}")
