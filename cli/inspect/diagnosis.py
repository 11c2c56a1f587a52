"""From what was seen to findings, on the way from the laptop to the robot's services. Pure.

A finding is ``ok``, ``note`` (worth knowing, hinders nothing), ``wrong``, or ``unknown`` because
something before it on the way is wrong.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

from cli.inspect import remedies
from common.messages import (
    Bumper,
    Driver,
    Health,
    Link,
    SafetyState,
    Switches,
    Ultrasonic,
)

Level = Literal["ok", "note", "wrong", "unknown"]

NEEDED = ("bridge", "safety", "odom")
LATE_S = 0.1  # a loop that is held up for longer
CLOCK_S = 1.0  # clocks that differ by more
SPREAD_S = 0.2  # half of what safety lets a request be under way


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at, and what to do about it."""

    where: str
    level: Level
    text: str
    todo: str = ""


@dataclass(frozen=True, slots=True)
class Dial:
    """What came of dialling one endpoint: ``trouble`` is empty when something answers."""

    endpoint: str
    trouble: str = ""
    todo: str = ""
    seconds: float = 0.0
    tried: bool = True  # UDP cannot be tried by itself


@dataclass(slots=True)
class Seen:
    """What was seen on the bus while the doctor listened."""

    zenoh: str  # this laptop's versions
    t2: str
    routers: list[str] = field(default_factory=list)  # their versions, where they tell
    instances: dict[str, int] = field(default_factory=dict)  # by service, by liveliness
    may_drive: bool | None = None
    may_call: bool | None = None
    health: dict[str, Health] = field(default_factory=dict)
    one_clock: bool = False  # whether the robot is this very host
    delays_s: list[float] = field(default_factory=list)  # by both wall clocks
    rates: dict[str, float] = field(default_factory=dict)  # Hz by path
    undecodable: dict[str, str] = field(default_factory=dict)  # why, by path
    first_link: Link | None = None
    link: Link | None = None
    switches: Switches | None = None
    bumper: Bumper | None = None
    ultrasonic: Ultrasonic | None = None
    drivers: dict[str, Driver] = field(default_factory=dict)  # by side
    safety: SafetyState | None = None
    asking: dict[str, set[int]] = field(default_factory=dict)  # boots by source
    deciding: set[int] = field(default_factory=set)  # boots on @cmd/motion


def network(dials: list[Dial]) -> Iterator[Finding]:
    """Tell whether there is anything at the router's endpoints; one that answers will do."""
    reached = any(not dial.trouble for dial in dials)
    for dial in dials:
        if dial.trouble:
            level: Level = "note" if reached else "wrong"
            yield Finding("network", level, f"{dial.endpoint}: {dial.trouble}", dial.todo)
        elif dial.tried:
            took = f"{dial.seconds * 1000:.1f} ms"
            yield Finding("network", "ok", f"{dial.endpoint} answers in {took}")
        else:
            yield Finding("network", "unknown", f"{dial.endpoint} cannot be tried by itself")


def router(seen: Seen) -> Iterator[Finding]:
    """Tell what router it is."""
    if not seen.routers:
        yield Finding("router", "note", "it does not tell its version (its admin space is closed)")
    for version in seen.routers:
        if version == seen.zenoh:
            yield Finding("router", "ok", f"Zenoh {version}, as on this laptop")
        else:
            text = f"Zenoh {version}, on this laptop {seen.zenoh}"
            yield Finding("router", "note", text, remedies.UPDATE)


def services(seen: Seen) -> Iterator[Finding]:
    """Tell whether the robot's own services are there once each, and not stuck."""
    for name in sorted({*NEEDED, *seen.instances}):
        count, health = seen.instances.get(name, 0), seen.health.get(name)
        if not count:
            yield Finding("services", "wrong", f"{name} is not there", remedies.START)
        elif count > 1 and name in NEEDED:
            yield Finding("services", "wrong", f"{name} is there {count} times", remedies.TWICE)
        elif not health:
            text = f"{name} is there and tells nothing of its health: it hangs"
            yield Finding("services", "wrong", text, remedies.HANGS)
        elif health.lateness > LATE_S:
            text = f"{name} is held up for {health.lateness:.2f} s at a time"
            yield Finding("services", "note", text, remedies.HELD_UP)
        else:
            yield Finding("services", "ok", f"{name} is up for {health.uptime:.0f} s")


def versions(seen: Seen) -> Iterator[Finding]:
    """Tell whether robot and laptop are of one version."""
    other = {name: h.version for name, h in seen.health.items() if h.version != seen.t2}
    for name, version in sorted(other.items()):
        text = f"{name} is T2 {version}, this laptop {seen.t2}"
        yield Finding("versions", "note", text, remedies.UPDATE)
    if seen.health and not other:
        yield Finding("versions", "ok", f"T2 {seen.t2} everywhere")
    for path, why in sorted(seen.undecodable.items()):
        yield Finding("versions", "wrong", f"{path}: {why}", remedies.UNDECODABLE)


def rights(seen: Seen) -> Iterator[Finding]:
    """Tell what the router lets this laptop do."""
    if not seen.instances:
        yield Finding(
            "rights", "unknown", "nobody is there, or the router's list lacks this certificate"
        )
        return
    if not seen.rates:
        yield Finding("rights", "wrong", "services are there and nothing is heard", remedies.BLIND)
        return
    may = {"driving": seen.may_drive, "calls": seen.may_call}
    barred = [what for what, allowed in may.items() if allowed is False]
    if barred:
        text = f"this laptop may watch; it has no way to safety for {' and '.join(barred)}"
        yield Finding("rights", "note", text, remedies.RIGHTS)
    elif None in may.values():
        yield Finding("rights", "unknown", "driving and calls want safety")
    else:
        yield Finding("rights", "ok", "this laptop may watch, call and drive")


def clock(seen: Seen) -> Iterator[Finding]:
    """Tell how clocks differ and how much the way wavers."""
    if not seen.delays_s:
        yield Finding("clock", "unknown", "nothing was heard")
        return
    least, most = min(seen.delays_s), max(seen.delays_s)
    if most - least > SPREAD_S:
        text = f"messages take up to {most - least:.2f} s longer than the fastest"
        yield Finding("clock", "note", text, remedies.SLOW_WAY)
    if seen.one_clock:
        yield Finding("clock", "ok", "the robot runs on this very host")
    elif abs(least) > CLOCK_S:
        way = "behind" if least < 0 else "ahead of"
        text = f"this laptop's clock is {abs(least):.1f} s {way} the robot's"
        yield Finding("clock", "note", text, remedies.CLOCK)
    else:
        yield Finding("clock", "ok", f"clocks agree to {abs(least) * 1000:.0f} ms")


def on_the_way(seen: Seen) -> Iterator[Finding]:
    """Return all findings between the router and the services."""
    for look in (router, services, versions, rights, clock):
        yield from look(seen)
