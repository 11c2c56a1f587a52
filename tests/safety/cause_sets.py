"""Sets of causes: what each cause does, and how to raise it in a policy fixture.

The actions are those of the safety case, written here a second time, not taken from the table in
``causes.py``.
"""

import sys
from collections.abc import Callable, Iterator
from itertools import combinations

from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.messages import ReleaseRequest
from common.motion import STILL, Twist
from common.standstill import Displacement
from services.safety.core.causes import FaultBudget
from services.safety.core.motion_watch import Axis, Phase, Standstill
from services.safety.core.sources import Channel, DriveChannel, Keepalives
from services.safety.core.state import State
from tests.safety.policy_fixture import PolicyFixture

BRAKING = {
    "contact", "estop", "estop_reader", "estop_keepalive", "predecessor", "runaway",
    "uncommanded_motion", "not_stopping",
}  # fmt: skip
LATCHING = (BRAKING - {"not_stopping"}) | {"driver_left", "driver_right", "flapping"}
INHIBITING = {
    "leaving", "starting", "link", "switches", "bumper", "silent", "unarmed", "not_stopping",
}  # fmt: skip
# Each one alone, with up to so many others: all sets of all causes would take four times as long.
RARE, OTHERS = {"uncommanded_motion", "not_stopping", "estop_keepalive"}, 3
AHEAD = Twist(0.3, 0.0)
STEP_NS = NS_PER_S // 50

Change = Callable[[PolicyFixture], None]


def sample(name: str, **fields: object) -> Change:
    """Return what changes fields of the newest sample of a stream."""

    def change(fixture: PolicyFixture) -> None:
        latest = getattr(fixture.inputs, name)
        changed = replace(latest, value=replace(latest.value, **fields))
        fixture.inputs = replace(fixture.inputs, **{name: changed})

    return change


def aged(name: str, age_s: float) -> Change:
    """Return what makes the newest sample of a stream that old."""

    def change(fixture: PolicyFixture) -> None:
        old = replace(
            getattr(fixture.inputs, name), received_ns=fixture.now_ns - round(age_s * NS_PER_S)
        )
        fixture.inputs = replace(fixture.inputs, **{name: old})

    return change


def missing(fixture: PolicyFixture) -> None:
    fixture.inputs = replace(fixture.inputs, ultrasonic=None)


def leaving(fixture: PolicyFixture) -> None:
    fixture.inputs = replace(fixture.inputs, leaving=True)


def spent(fixture: PolicyFixture) -> None:
    fixture.state = replace(fixture.state, fault_budget=FaultBudget(0.0, fixture.now_ns))


def ran_away(fixture: PolicyFixture) -> None:
    fixture.state = replace(
        fixture.state, motion=replace(fixture.state.motion, linear=Axis(bad_s=0.3))
    )
    sample("velocity", linear=2.0)(fixture)


def supervised(fixture: PolicyFixture, standstill: Standstill) -> None:
    verdict = replace(fixture.state.verdict, command="stop", twist=STILL)
    fixture.state = replace(
        fixture.state, motion=replace(fixture.state.motion, standstill=standstill), verdict=verdict
    )


def left_its_place(fixture: PolicyFixture) -> None:
    supervised(fixture, Standstill(Phase.STANDING, displacement=Displacement(counted=Twist(0.06))))


def does_not_stop(fixture: PolicyFixture) -> None:
    sample("velocity", linear=2.0)(fixture)
    supervised(fixture, Standstill(Phase.STOPPING, due_ns=fixture.now_ns - 1))


def nobody_hears(fixture: PolicyFixture) -> None:
    fixture.estop_connection = 0


def not_kept_alive(fixture: PolicyFixture) -> None:
    channels = {"pendant": Channel(boot=1, received_ns=fixture.now_ns - 2 * NS_PER_S)}
    keepalives = Keepalives(("pendant",), 1.0, channels)
    fixture.state = replace(fixture.state, keepalives=keepalives)


RAISE: dict[str, Change] = {
    "contact": sample("bumper", pressed=True),
    "estop": lambda fixture: None,  # an event, not a sample
    "estop_reader": nobody_hears,
    "estop_keepalive": not_kept_alive,
    "predecessor": sample("link", latched_by=4711),
    "runaway": ran_away,
    "uncommanded_motion": left_its_place,
    "not_stopping": does_not_stop,
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


def report(text: str) -> None:
    """Show a number to ``pytest -s``."""
    sys.stdout.write(f"\n{text}\n")


def subsets(names: set[str]) -> Iterator[set[str]]:
    ordered = sorted(names)
    for size in range(len(ordered) + 1):
        yield from map(set, combinations(ordered, size))


def crossed(names: set[str]) -> Iterator[set[str]]:
    """Yield all subsets; those with a cause of RARE only with few others, and with one."""
    for others in subsets(names - RARE):
        yield others
        if len(others) <= OTHERS:
            yield from (others | {name} for name in sorted(names & RARE))


def fresh(
    fixture: PolicyFixture,
    state: State,
    requested: Twist | None,
    armed: bool,
    release: ReleaseRequest = "none",
) -> None:
    """Give the fixture a memory, all samples good and new, and one request or none."""
    channels = {}
    if requested is not None:
        channels["teleop"] = DriveChannel(
            boot=99, seq=fixture.driver_seq, received_ns=fixture.now_ns, requested=requested,
            release=release, neutral=armed, neutral_ns=fixture.now_ns - 1,
        )  # fmt: skip
    arbiter = replace(state.arbiter, channels=channels)
    fixture.state = replace(state, arbiter=arbiter, decided_ns=fixture.now_ns - STEP_NS)
    fixture.estop_connection = 1
    fixture.inputs = replace(fixture.inputs, leaving=False)
    fixture.seq = state.verdict.acked[1]  # no bumper sample was lost
    fixture.feed()
