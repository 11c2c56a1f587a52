"""Every combination of causes, latches and requests once: what may move the vehicle and what not.

What is expected comes from the safety case, as in ``cause_sets.py``. ``pytest -s`` prints how many
combinations were walked.
"""

import math
from dataclasses import dataclass
from itertools import product, starmap

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.messages import SONAR_NAMES, Direction, ReleaseRequest
from common.motion import STILL, Command, Twist
from services.safety.core.causes import RULES, Clears, FaultBudget, Held, latched, ordered
from services.safety.core.inputs import Estop, Event, Reset
from services.safety.core.motion_watch import MotionWatch
from services.safety.core.release import Release
from services.safety.core.state import State, Verdict
from tests.safety.cause_sets import (
    AHEAD,
    BRAKING,
    INHIBITING,
    LATCHING,
    OTHERS,
    RAISE,
    crossed,
    fresh,
    report,
    sample,
    subsets,
)
from tests.safety.policy_fixture import NO_ECHO, PolicyFixture

pytestmark = pytest.mark.campaign  # it takes half a minute

HELD_CLEARS = (Clears.RESET, Clears.SETTLED)
HOUR_NS = 3600 * NS_PER_S


def test_every_set_of_causes_stops_and_latches_as_it_must() -> None:
    fixture = PolicyFixture().running(0.3)
    before, walked = fixture.state, 0
    for raised in crossed(LATCHING | INHIBITING):
        if {"link", "unarmed"} <= raised:
            continue  # arming is unknown while the link is lost
        fresh(fixture, before, AHEAD, armed=True)
        for name in raised:
            RAISE[name](fixture)
        if "starting" not in raised and "estop_reader" in raised:
            raised = raised | {"starting"}  # there is no emergency stop without its reader
        verdict = fixture.decide(Estop() if "estop" in raised else None)
        walked += 1
        assert set(fixture.state.latches) - {"sonar", "blocked"} == raised
        check_action(verdict, raised)
        later(fixture, raised)
    report(f"{walked} sets of causes, each with a request to drive, and an hour later")
    few = sum(math.comb(15, size) for size in range(OTHERS + 1))
    few_without_arming = sum(math.comb(13, size - 2) for size in range(2, OTHERS + 1))
    assert walked == 2**15 - 2**13 + 3 * (few - few_without_arming)


def check_action(verdict: Verdict, raised: set[str]) -> None:
    """The worst action wins, and only without any cause the vehicle drives."""
    expected = "brake" if raised & BRAKING else "stop" if raised else "run"
    assert verdict.command == expected, raised
    assert verdict.twist.is_zero == bool(raised)
    assert (verdict.name == "inhibited") == bool(raised and not raised & (LATCHING | BRAKING))


def later(fixture: PolicyFixture, raised: set[str]) -> None:
    """An hour later, all inputs are good and a source requests motion: latches persist."""
    fixture.now_ns += HOUR_NS
    state = replace(
        fixture.state, decided_ns=fixture.now_ns, motion=MotionWatch(), fault_budget=FaultBudget()
    )
    wished = {"teleop": replace(state.arbiter.channels["teleop"], received_ns=fixture.now_ns)}
    fixture.state = replace(state, arbiter=replace(state.arbiter, channels=wished))
    fixture.estop_connection = 1
    fixture.inputs = replace(fixture.inputs, leaving=False)
    fixture.feed()
    verdict = fixture.decide()
    assert set(latched(fixture.state.latches)) == raised & LATCHING
    assert (verdict.command == "run") == (not raised)
    fixture.now_ns -= HOUR_NS


REQUESTS: dict[str, Twist | None] = {
    "none": None, "zero": STILL, "motion": AHEAD, "forward": STILL, "backward": STILL,
}  # fmt: skip
RELEASES: dict[str, ReleaseRequest] = {"forward": "forward", "backward": "backward"}
MOVING = ("motion", *RELEASES)
RESETS = ("reset", "reset one", "reset unknown", "reset nothing", "reset late")
CALLS = ("none", *RESETS)
RIGHT_CALLS = ("none", "reset", "reset one")
WAYS = ("unused", "held backward", "held backward, forbidden")
LATE_TICKS = 100  # two seconds


@dataclass(frozen=True, slots=True)
class Case:
    """One combination: what is latched, asked for and called, and what is so meanwhile."""

    held: set[str]
    asked: str
    call: str
    pressed: bool
    way: str  # what a release of this contact did so far
    inhibited: str  # not at all; still to settle; by something that is there

    def is_telling(self) -> bool:
        """Leave out what adds nothing: a way off without a press, wrong calls while inhibited."""
        right = self.inhibited == "none" or self.call in RIGHT_CALLS
        return right and (self.pressed or self.way == "unused")

    def prepare(self, fixture: PolicyFixture, before: State) -> None:
        """Make it so."""
        now_ns = fixture.now_ns
        gone = Held(now_ns - NS_PER_S, now_ns - NS_PER_S, 3, (0, 0), "gone")
        latches = {name: replace(gone, id=IDS[name]) for name in self.held}
        if self.pressed and "contact" in self.held:
            latches["contact"] = replace(latches["contact"], good=0)  # the same press
        if self.inhibited == "due":
            latches["link"] = replace(gone, bad_ns=now_ns)
        armed = not self.held and self.inhibited == "none"
        state = replace(before, latches=latches, release=self.release(now_ns))
        release = RELEASES.get(self.asked, "none")
        fresh(fixture, state, REQUESTS[self.asked], armed, release)
        sample("velocity", linear=0.0)(fixture)
        if self.pressed:
            RAISE["contact"](fixture)
        if self.inhibited == "there":
            RAISE["link"](fixture)

    def release(self, now_ns: int) -> Release:
        """Return the memory of the release."""
        if self.way == "unused":
            return Release()
        held = Release(moved_ns=now_ns, source="teleop", direction="backward")
        forbidden: frozenset[Direction] = frozenset({"backward"})
        return replace(held, forbidden=forbidden) if "forbidden" in self.way else held

    def event(self, echo: int) -> Event | None:
        """Return the call."""
        ids = tuple(IDS[name] for name in ordered(self.held))
        late = echo - LATE_TICKS
        events: dict[str, Event] = {
            "reset": Reset(echo, ids),
            "reset one": Reset(echo, ids[:1]),
            "reset unknown": Reset(echo, (*ids, 99)),
            "reset nothing": Reset(echo, ()),
            "reset late": Reset(late, ids),
        }
        return events.get(self.call)

    @property
    def creeps(self) -> float:
        """Which way a release moves the vehicle, off a contact that is all there is."""
        if not self.pressed or self.held != {"contact"} or self.inhibited != "none":
            return 0.0  # also at a new press: the key was held before
        if self.asked == "forward":
            return 0.0 if "held" in self.way else 1.0  # first it must be let go
        return -1.0 if self.asked == "backward" and "forbidden" not in self.way else 0.0

    @property
    def drives(self) -> bool:
        """Whether an armed request has nothing against it."""
        good = not self.held and not self.pressed and self.inhibited == "none"
        return good and self.asked == "motion"

    @property
    def cleared(self) -> set[str]:
        """Return the causes that a reset clears; none if it is refused."""
        if self.call not in ("reset", "reset one") or self.asked in MOVING:
            return set()
        if self.pressed and "contact" not in self.held:
            return set()  # the operator has not seen a hit of the same decision
        named = ordered(self.held)[: None if self.call == "reset" else 1]
        return set(named) - ({"contact"} if self.pressed else set())


IDS = {name: number for number, name in enumerate(sorted(LATCHING), 1)}


def test_every_set_of_latches_under_every_request_and_call() -> None:
    fixture = PolicyFixture().running(0.3)
    before, walked = replace(fixture.state, verdict=Verdict()), 0
    axes = crossed(LATCHING), REQUESTS, CALLS, (False, True), WAYS, ("none", "due", "there")
    for case in filter(Case.is_telling, starmap(Case, product(*axes))):
        case.prepare(fixture, before)
        verdict = fixture.decide(case.event(fixture.echo))
        walked += 1
        check_reset(case, verdict, fixture.state)
        check_run(case, verdict)
    report(f"{walked} sets of latches with requests, calls, releases and inhibitions")
    few = sum(math.comb(8, size) for size in range(OTHERS + 1))
    assert walked == (2**8 + 2 * few) * 5 * (6 + 3 + 3) * (1 + 3)


def check_reset(case: Case, verdict: Verdict, state: State) -> None:
    """Only an operator's reset clears, and what it names only, but for a pressed bumper."""
    if case.call in RESETS:
        assert verdict.reply is not None
        assert verdict.reply.done == bool(case.cleared)
        assert set(verdict.reply.cleared) == {IDS[name] for name in case.cleared}
    remains = case.held - case.cleared
    assert set(latched(state.latches)) == remains | ({"contact"} if case.pressed else set())


def check_run(case: Case, verdict: Verdict) -> None:
    """Nothing moves but what an armed request or a held release asks for."""
    if case.drives:
        assert verdict.command == "run"
        assert verdict.twist.linear > 0
    elif case.creeps:
        assert 0 < verdict.twist.linear * case.creeps <= 0.1
    else:
        assert verdict.twist.is_zero, case


# Where each sonar looks, clockwise from the left; the vehicle is 1.10 by 0.70 m.
LOOKS = {name: math.radians(90 - 45 * n) for n, name in enumerate(SONAR_NAMES)}
TWISTS = [Twist(0.3), Twist(-0.3), Twist(0, 0.3), Twist(0, -0.3), Twist(0.3, 0.3), Twist(-0.3, 0.3)]


def closes_in(name: str, twist: Twist) -> bool:
    """Return whether a twist moves the vehicle toward what a sonar sees."""
    yaw = LOOKS[name]
    x = 0.55 * (round(math.cos(yaw), 3) > 0) - 0.55 * (round(math.cos(yaw), 3) < 0)
    y = 0.35 * (round(math.sin(yaw), 3) > 0) - 0.35 * (round(math.sin(yaw), 3) < 0)
    along = (twist.linear - twist.angular * y) * math.cos(yaw) + twist.angular * x * math.sin(yaw)
    return along > 1e-6 or (name in ("left", "right") and twist.angular != 0)


def test_every_set_of_blocked_sonars_under_every_way_to_move() -> None:
    walked = 0
    for bad in subsets(set(SONAR_NAMES)):
        for distance in (0.2, None):
            fixture = PolicyFixture().ready()
            fixture.status = NO_ECHO
            fixture.sonar(**dict.fromkeys(bad, distance))
            fixture.tick()
            standing = fixture.state
            for twist in TWISTS:
                fresh(
                    fixture,
                    replace(standing, verdict=Verdict("run", Command.RUN)),
                    twist,
                    armed=True,
                )
                verdict = fixture.decide()
                walked += 1
                blocked = any(closes_in(name, twist) for name in bad)
                assert ("blocked" in fixture.state.latches) == blocked, (bad, twist)
                assert (verdict.command == "run") == (not blocked), (bad, twist)
    report(f"{walked} sets of blocked or faulty sonars with ways to move")
    assert walked == 2**8 * 2 * len(TWISTS)


def test_the_walk_knows_every_cause_that_latches_or_inhibits() -> None:
    wanting = {rule.name for rule in RULES if rule.clears in HELD_CLEARS}
    assert set(RAISE) == LATCHING | INHIBITING == wanting
