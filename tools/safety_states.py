"""State diagram of safety in ``docs/safety.md``, by exploration of the real policy.

The exploration applies every stimulus of a list in every situation that it reaches, until it finds
no new one. A state of the diagram is a verdict, with or without a reset due; each arrow is an
observed transition.
"""

from collections.abc import Callable, Iterator
from functools import cache
from typing import TypeVar

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from common.messages import (
    Bumper,
    Drive,
    Driver,
    Link,
    Message,
    RangeStatus,
    Switches,
    Ultrasonic,
    Velocity,
)
from common.settings import Vehicle
from services.safety.causes import RULES, SEVERITY, Clears, clears
from services.safety.config import Safety
from services.safety.inputs import DriveRequest, Estop, Event, Hold, Inputs, Reset
from services.safety.latches import latched
from services.safety.policy import Policy
from services.safety.state import State

TICK_NS = NS_PER_S // 20
QUICK, PATIENCE = 8, 14  # ticks: longer than a request's lease; longer than inputs settle
FREE_M, NEAR_M, INSIDE_M = None, 0.3, 0.1
FRONT = (1, 2, 3)  # of the sonars
M = TypeVar("M", bound=Message)
DRIVER_BOOT, BRIDGE_BOOT = 1, 2


class Situation(Struct, frozen=True):
    """The policy's environment and its state."""

    state: State
    now_ns: int = 10 * NS_PER_S
    seq: int = 0
    asks: float | None = None  # m/s; None: no requests
    holds: bool = False  # the release
    link: bool = True
    pressed: bool = False
    faulty: bool = False
    ahead_m: float | None = FREE_M

    @property
    def disturbances(self) -> int:
        """Number of simultaneous disturbances; the exploration continues from at most one."""
        blocked = self.ahead_m is not FREE_M
        without_cause = 2 * (self.holds and not self.pressed)
        return (not self.link) + self.pressed + self.faulty + blocked + without_cause

    @property
    def name(self) -> str:
        """State in the diagram."""
        verdict = self.state.verdict
        if verdict.source == "release":
            return "creeping"
        if verdict.name == "stop" and latched(self.state.latches):
            return "stop_latched"
        return verdict.name


Stimulus = Callable[[Situation], tuple[Situation, Event | None]]

STIMULI: dict[str, Stimulus] = {
    "inputs good": lambda it: (replace(it, link=True), None),
    "an input is lost": lambda it: (replace(it, link=False), None),
    "zero is asked": lambda it: (replace(it, asks=0.0), None),
    "motion is asked": lambda it: (replace(it, asks=0.3), None),
    "nobody asks": lambda it: (replace(it, asks=None), None),
    "bumper hit": lambda it: (replace(it, pressed=True), None),
    "bumper free": lambda it: (replace(it, pressed=False), None),
    "driver fault": lambda it: (replace(it, faulty=True), None),
    "driver well": lambda it: (replace(it, faulty=False), None),
    "obstacle near": lambda it: (replace(it, ahead_m=NEAR_M), None),
    "obstacle in the margin": lambda it: (replace(it, ahead_m=INSIDE_M), None),
    "way free": lambda it: (replace(it, ahead_m=FREE_M), None),
    "emergency stop": lambda it: (it, Estop()),
    "reset": lambda it: (it, _reset(it)),
    "release held": lambda it: (replace(it, holds=True), None),
    "release let go": lambda it: (replace(it, holds=False), Hold(False)),
}


@cache
def transitions() -> list[tuple[str, str, str]]:
    """Return all transitions as from, stimulus, to; sorted."""
    policy = Policy(Safety(), Vehicle())
    first = _run(policy, Situation(policy.start(), link=False), None)
    known, due = {_signature(first)}, [first]
    found = {("[*]", "", first.name)}
    while due:
        before = due.pop()
        idle = _run(policy, before, None).name
        if idle != before.name:
            found.add((before.name, "time", idle))
        for name, stimulus in STIMULI.items():
            changed, event = stimulus(before)
            if changed == before and event is None:
                continue
            after = _run(policy, changed, event)
            if after.name not in (before.name, idle):
                found.add((before.name, name, after.name))
            if after.disturbances <= 1 and _signature(after) not in known:
                known.add(_signature(after))
                due.append(after)
    return sorted(found)


def diagram() -> str:
    """Return the states as a Mermaid diagram; stimuli with the same ends share an arrow."""
    arrows: dict[tuple[str, str], list[str]] = {}
    for before, why, after in transitions():
        arrows.setdefault((before, after), []).append(why)
    lines = ["```mermaid", "stateDiagram-v2"]
    for (before, after), reasons in arrows.items():
        label = f" : {', '.join(reasons)}" if any(reasons) else ""
        lines.append(f"    {before} --> {after}{label}")
    return "\n".join([*lines, "```"])


def causes() -> Iterator[tuple[str, str, str, str, str]]:
    """Yield a row for each cause: name, action, latched, clearing, text; most severe first."""
    how = {
        Clears.RESET: "reset",
        Clears.SETTLED: "by itself after 0.5 s, then a neutral request",
        Clears.NEUTRAL: "by itself, then a neutral request",
        Clears.AT_ONCE: "by itself",
    }
    for rule in sorted(RULES, key=lambda rule: -SEVERITY[rule.action]):
        yes = "yes" if rule.clears is Clears.RESET else "no"
        yield f"`{rule.name}`", rule.action.upper(), yes, how[rule.clears], rule.text


def _signature(situation: Situation) -> tuple[object, ...]:
    """Return the part of a situation that distinguishes it from others."""
    armed = any(one.neutral for one in situation.state.arbiter.channels.values())
    around = (
        situation.asks,
        situation.holds,
        situation.link,
        situation.pressed,
        situation.faulty,
        situation.ahead_m,
    )
    return situation.name, armed, latched(situation.state.latches), around


def _reset(situation: Situation) -> Reset:
    """Return an operator's call for everything that is latched."""
    latches = situation.state.latches
    ids = tuple(latches[name].id for name in latched(latches))
    return Reset(situation.state.heartbeat.number, ids)


def _run(policy: Policy, situation: Situation, event: Event | None) -> Situation:
    """Simulate a stimulus, with an event at its beginning, until the policy has settled."""
    for tick in range(PATIENCE):
        settling = any(clears(name) is Clears.SETTLED for name in situation.state.latches)
        if tick >= QUICK and not (situation.link and settling):
            break
        situation = replace(situation, now_ns=situation.now_ns + TICK_NS, seq=situation.seq + 1)
        beat = situation.state.heartbeat.beat(situation.now_ns)
        situation = replace(situation, state=replace(situation.state, heartbeat=beat))
        for one in _events(situation, event if tick == 0 else None):
            inputs = replace(_inputs(situation), event=one)
            state, _ = policy.decide(situation.state, inputs, situation.now_ns)
            situation = replace(situation, state=state)
    return situation


def _events(situation: Situation, event: Event | None) -> Iterator[Event | None]:
    yield event
    if situation.asks is not None:
        drive = Drive(
            linear=situation.asks,
            angular=0.0,
            echo=situation.state.heartbeat.number,
            seq=situation.seq,
            boot=DRIVER_BOOT,
        )
        yield DriveRequest("teleop", drive, situation.now_ns)
    if situation.holds:
        yield Hold(True, "backward", situation.state.heartbeat.number)


def _inputs(situation: Situation) -> Inputs:
    status: list[RangeStatus] = ["no_echo"] * 8
    ranges: list[float | None] = [None] * 8
    for sonar in FRONT if situation.ahead_m is not None else ():
        status[sonar], ranges[sonar] = "ok", situation.ahead_m
    way = "" if situation.link else "link lost"
    link = Link(
        state="up" if situation.link else "lost", board="", epoch=0, armed=situation.link,
        waiting=way, rates={}, rejected={}, round_trip=None,
    )  # fmt: skip
    twist = situation.state.verdict.twist
    return Inputs(
        velocity=_new(Velocity(linear=twist.linear, angular=twist.angular), situation),
        ultrasonic=_new(Ultrasonic(ranges=tuple(ranges), status=tuple(status)), situation),
        bumper=_new(Bumper(pressed=situation.pressed), situation),
        left=_new(Driver(faults=(), bits=int(situation.faulty)), situation),
        right=_new(Driver(faults=(), bits=0), situation),
        switches=_new(Switches(ultrasonic_brake=True, bumper_brake=True), situation),
        link=_new(link, situation),
        estop_connection=1,
    )


def _new(message: M, situation: Situation) -> Latest[M]:
    """Return a sample that has just arrived."""
    return Latest(replace(message, seq=situation.seq, boot=BRIDGE_BOOT), situation.now_ns)
