"""Every combination of causes, latches and requests once: what may move the vehicle and what not.

What is expected is written down here a second time, from the safety case, not taken from the
table in ``causes.py``. ``pytest -s`` prints how many combinations were walked.
"""

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations, product, starmap

from msgspec.structs import replace

from common.freshness import S
from common.messages import SONAR_NAMES
from services.safety.arbiter import Channel
from services.safety.causes import RULES, Clears
from services.safety.flapping import Credit
from services.safety.inputs import Estop, Event, Hold, Reset
from services.safety.latches import Held, latched
from services.safety.release import Release
from services.safety.runaway import Axis
from services.safety.state import RELEASE, State, Verdict
from services.safety.twist import STILL, Twist
from tests.safety.scene import NO_ECHO, Scene

BRAKING = {"contact", "estop", "estop_reader", "predecessor", "runaway"}
LATCHING = BRAKING | {"driver_left", "driver_right", "flapping"}
INHIBITING = {"leaving", "starting", "link", "switches", "bumper", "silent", "unarmed"}
AHEAD = Twist(0.3, 0.0)
HOUR_NS, STEP_NS = 3600 * S, S // 50

Change = Callable[[Scene], None]


def sample(name: str, **fields: object) -> Change:
    """Return what changes fields of the newest sample of a stream."""

    def change(scene: Scene) -> None:
        latest = getattr(scene.inputs, name)
        changed = replace(latest, value=replace(latest.value, **fields))
        scene.inputs = replace(scene.inputs, **{name: changed})

    return change


def aged(name: str, age_s: float) -> Change:
    """Return what makes the newest sample of a stream that old."""

    def change(scene: Scene) -> None:
        old = replace(getattr(scene.inputs, name), received_ns=scene.now_ns - round(age_s * S))
        scene.inputs = replace(scene.inputs, **{name: old})

    return change


def missing(scene: Scene) -> None:
    scene.inputs = replace(scene.inputs, ultrasonic=None)


def leaving(scene: Scene) -> None:
    scene.inputs = replace(scene.inputs, leaving=True)


def spent(scene: Scene) -> None:
    scene.state = replace(scene.state, credit=Credit(0.0, scene.now_ns))


def ran_away(scene: Scene) -> None:
    scene.state = replace(scene.state, linear=Axis(bad_s=0.3))
    sample("velocity", linear=2.0)(scene)


def nobody_hears(scene: Scene) -> None:
    scene.reader = False


RAISE: dict[str, Change] = {
    "contact": sample("bumper", pressed=True),
    "estop": lambda scene: None,  # an event, not a sample
    "estop_reader": nobody_hears,
    "predecessor": sample("link", latched_by=4711),
    "runaway": ran_away,
    "driver_left": sample("left", bits=1),
    "driver_right": sample("right", bits=1 << 31),
    "flapping": spent,
    "leaving": leaving,
    "starting": missing,
    "link": sample("link", state="lost"),
    "switches": sample("switches", bumper_brake=False),
    "bumper": aged("bumper", 0.16),
    "silent": aged("left", 2.1),
    "unarmed": sample("link", armed=False),
}


def tell(text: str) -> None:
    """Show a number to ``pytest -s``."""
    sys.stdout.write(f"\n{text}\n")


def subsets(names: set[str]) -> Iterator[set[str]]:
    ordered = sorted(names)
    for size in range(len(ordered) + 1):
        yield from map(set, combinations(ordered, size))


def fresh(scene: Scene, state: State, wish: Twist | None, armed: bool) -> None:
    """Give the scene a memory, all samples good and new, and one request or none."""
    channels = {}
    if wish is not None:
        channels["teleop"] = Channel(99, scene.driver_seq, wish, scene.now_ns, None, armed)
    arbiter = replace(state.arbiter, channels=channels)
    scene.state = replace(state, arbiter=arbiter, decided_ns=scene.now_ns - STEP_NS)
    scene.reader = True
    scene.inputs = replace(scene.inputs, leaving=False)
    scene.seq = state.verdict.judged[1]  # no bumper sample was lost
    scene.feed()


def test_every_set_of_causes_stops_and_latches_as_it_must() -> None:
    scene = Scene().running(0.3)
    before, walked = scene.state, 0
    for raised in subsets(LATCHING | INHIBITING):
        if {"link", "unarmed"} <= raised:
            continue  # a link that is lost says nothing about arming
        fresh(scene, before, AHEAD, armed=True)
        for name in raised:
            RAISE[name](scene)
        if "starting" not in raised and "estop_reader" in raised:
            raised = raised | {"starting"}  # there is no emergency stop without its reader
        verdict = scene.decide(Estop() if "estop" in raised else None)
        walked += 1
        assert set(scene.state.latches) - {"sonar", "blocked"} == raised
        check_action(verdict, raised)
        later(scene, raised)
    tell(f"{walked} sets of causes, each with a request to drive, and an hour later")
    assert walked == 2**15 - 2**13


def check_action(verdict: Verdict, raised: set[str]) -> None:
    """The worst action wins, and only without any cause the vehicle drives."""
    expected = "brake" if raised & BRAKING else "stop" if raised else "run"
    assert verdict.command == expected, raised
    assert verdict.twist.is_zero == bool(raised)
    assert (verdict.name == "inhibited") == bool(raised and not raised & LATCHING)


def later(scene: Scene, raised: set[str]) -> None:
    """An hour later all is well again and somebody asks to drive: what latched still holds."""
    scene.now_ns += HOUR_NS
    state = replace(scene.state, decided_ns=scene.now_ns, linear=Axis(), credit=Credit())
    wished = {"teleop": replace(state.arbiter.channels["teleop"], received_ns=scene.now_ns)}
    scene.state = replace(state, arbiter=replace(state.arbiter, channels=wished))
    scene.reader = True
    scene.inputs = replace(scene.inputs, leaving=False)
    scene.feed()
    verdict = scene.decide()
    assert set(latched(scene.state.latches)) == raised & LATCHING
    assert (verdict.command == "run") == (not raised)
    scene.now_ns -= HOUR_NS


REQUESTS: dict[str, Twist | None] = {"none": None, "zero": STILL, "motion": AHEAD}
CALLS: dict[str, Event | None] = {"none": None, "reset": Reset(), "hold": Hold(True)}
BACK = Release(before=AHEAD)  # the way that led onto the bumper


@dataclass(frozen=True, slots=True)
class Case:
    """One combination: what is latched, asked for and called, and what is so meanwhile."""

    held: set[str]
    asked: str
    call: str
    pressed: bool
    crept: bool  # whether the release was held before
    inhibited: str  # not at all; still to settle; by something that is there

    def prepare(self, scene: Scene, before: State) -> None:
        """Make it so."""
        now_ns = scene.now_ns
        gone = Held(now_ns - S, now_ns - S, 3, (0, 0), "gone")
        latches = dict.fromkeys(self.held, gone)
        if self.pressed and "contact" in self.held:
            latches["contact"] = replace(gone, good=0)  # the same press, not a new one
        if self.inhibited == "due":
            latches["link"] = replace(gone, bad_ns=now_ns)
        release = replace(BACK, held_ns=now_ns if self.crept else None)
        armed = not self.held and self.inhibited == "none"
        state = replace(before, latches=latches, release=release)
        fresh(scene, state, REQUESTS[self.asked], armed)
        sample("velocity", linear=0.0)(scene)
        if self.pressed:
            RAISE["contact"](scene)
        if self.inhibited == "there":
            RAISE["link"](scene)

    @property
    def creeps(self) -> bool:
        """Whether a release holds, off a contact that is all there is."""
        alone = self.pressed and not self.held - {"contact"} and self.inhibited == "none"
        # A hold is good for the press that it was meant for.
        return alone and ((self.crept and "contact" in self.held) or self.call == "hold")

    @property
    def drives(self) -> bool:
        """Whether an armed request has nothing against it."""
        good = not self.held and not self.pressed and self.inhibited == "none"
        return good and self.asked == "motion"


def test_every_set_of_latches_under_every_request_and_call() -> None:
    scene = Scene().running(0.3)
    before, walked = replace(scene.state, verdict=Verdict(), release=BACK, moved=AHEAD), 0
    yes_no = (False, True)
    axes = subsets(LATCHING), REQUESTS, CALLS, yes_no, yes_no, ("none", "due", "there")
    for case in starmap(Case, product(*axes)):
        case.prepare(scene, before)
        verdict = scene.decide(CALLS[case.call])
        walked += 1
        check_reset(case, verdict, scene.state)
        check_run(case, verdict)
    tell(f"{walked} sets of latches with requests, calls, releases and inhibitions")
    assert walked == 2**8 * 3 * 3 * 2 * 2 * 3


def check_reset(case: Case, verdict: Verdict, state: State) -> None:
    """Only an operator's reset clears, and all at once, but for a bumper that is pressed."""
    stays = {"contact"} if case.pressed else set()
    remains = case.held | stays
    if case.call == "reset":
        assert verdict.reply is not None
        # Who resets does not know of a hit that comes along.
        allowed = case.asked != "motion" and remains > stays and stays <= case.held
        assert verdict.reply.done == (allowed or not remains)
        remains = stays if allowed else remains
    assert set(latched(state.latches)) == remains


def check_run(case: Case, verdict: Verdict) -> None:
    """Nothing moves but what an armed request or a held release asks for."""
    if case.drives:
        assert verdict.command == "run"
        assert verdict.twist.linear > 0
    elif case.creeps:
        assert verdict.source == RELEASE
        assert -0.1 <= verdict.twist.linear < 0
    else:
        assert verdict.twist.is_zero, case


# Where each sonar looks, clockwise from the left; the vehicle is 1.10 by 0.70 m.
LOOKS = {name: math.radians(90 - 45 * n) for n, name in enumerate(SONAR_NAMES)}
TWISTS = [Twist(0.3), Twist(-0.3), Twist(0, 0.3), Twist(0, -0.3), Twist(0.3, 0.3), Twist(-0.3, 0.3)]


def closes_in(name: str, twist: Twist) -> bool:
    """Tell whether a twist moves the vehicle toward what a sonar sees."""
    yaw = LOOKS[name]
    x = 0.55 * (round(math.cos(yaw), 3) > 0) - 0.55 * (round(math.cos(yaw), 3) < 0)
    y = 0.35 * (round(math.sin(yaw), 3) > 0) - 0.35 * (round(math.sin(yaw), 3) < 0)
    along = (twist.linear - twist.angular * y) * math.cos(yaw) + twist.angular * x * math.sin(yaw)
    return along > 1e-6 or (name in ("left", "right") and twist.angular != 0)


def test_every_set_of_blocked_sonars_under_every_way_to_move() -> None:
    walked = 0
    for bad in subsets(set(SONAR_NAMES)):
        for distance in (0.2, None):
            scene = Scene().ready()
            scene.status = NO_ECHO
            scene.sonar(**dict.fromkeys(bad, distance))
            scene.tick()
            standing = scene.state
            for twist in TWISTS:
                fresh(scene, replace(standing, verdict=Verdict("run", "run")), twist, armed=True)
                verdict = scene.decide()
                walked += 1
                blocked = any(closes_in(name, twist) for name in bad)
                assert ("blocked" in scene.state.latches) == blocked, (bad, twist)
                assert (verdict.command == "run") == (not blocked), (bad, twist)
    tell(f"{walked} sets of blocked or faulty sonars with ways to move")
    assert walked == 2**8 * 2 * len(TWISTS)


def test_the_walk_knows_every_cause_that_latches_or_inhibits() -> None:
    wanting = {rule.name for rule in RULES if rule.clears is not Clears.AT_ONCE}
    assert set(RAISE) == LATCHING | INHIBITING == wanting
