"""Diagnosis from the laptop to the robot's services, from an observation of the bus. Pure.

A finding is ``ok``, ``note`` (information, no effect), ``wrong``, or ``unknown`` because an earlier
part of the path is wrong.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal, TypeVar

from cli.inspect import remedies
from common import keys
from common.keys import Topic
from common.messages import Health, Message

M = TypeVar("M", bound=Message)
Level = Literal["ok", "note", "wrong", "unknown"]

NEEDED = ("bridge", "safety", "odom")
LATE_S = 0.1  # loop lateness that is reported
CLOCK_S = 1.0  # clock offset that is reported
SPREAD_S = 0.2  # delay variation; half of safety's limit for the delay of a request


@dataclass(frozen=True, slots=True)
class Finding:
    """One check with its result and remedy."""

    where: str
    level: Level
    text: str
    todo: str = ""


@dataclass(slots=True)
class Observation:
    """Everything that the doctor has observed on the bus; paths are keys below the robot."""

    zenoh: str  # this laptop's versions
    t2: str
    routers: list[str] = field(default_factory=list)  # their versions, where readable
    instances: dict[str, int] = field(default_factory=dict)  # by service, from tokens
    others: list[str] = field(default_factory=list)  # other robots at the same router
    may_drive: bool | None = None
    may_call: bool | None = None
    one_clock: bool = False  # whether the robot runs on this host
    delays_s: list[float] = field(default_factory=list)  # by both wall clocks
    rates: dict[str, float] = field(default_factory=dict)  # Hz by path
    undecodable: dict[str, str] = field(default_factory=dict)  # reason by path
    first: dict[str, Message] = field(default_factory=dict)  # message by path
    newest: dict[str, Message] = field(default_factory=dict)  # message by path
    ros_tokens: list[str] = field(default_factory=list)  # of all nodes of ROS 2
    ros_place: tuple[int, str] | None = None  # domain and namespace of the gateway

    def add(self, path: str, message: Message) -> None:
        """Add a message."""
        self.first.setdefault(path, message)
        self.newest[path] = message

    def of(self, topic: Topic[M], **names: str) -> M | None:
        """Return the newest message of a topic."""
        found = self.newest.get(topic.path.format(**names))
        return found if isinstance(found, topic.message) else None

    def health(self) -> dict[str, Health]:
        """Return the newest health message of each service."""
        return {each.service: each for each in self.newest.values() if isinstance(each, Health)}

    def sent_hz(self, path: str) -> float:
        """Return the rate at which a stream is sent, by its publisher's health; 0 if unknown."""
        publisher = self.of(keys.HEALTH, service=path.split("/")[1])
        rates = publisher.rates if publisher else {}
        return next((hz for key, hz in rates.items() if key.endswith(f"/{path}")), 0.0)


def router(seen: Observation) -> Iterator[Finding]:
    """Report the router's version."""
    if not seen.routers:
        yield Finding("router", "note", "version unknown (the router's admin space is closed)")
    for version in seen.routers:
        if version == seen.zenoh:
            yield Finding("router", "ok", f"Zenoh {version}, as on this laptop")
        else:
            text = f"Zenoh {version}, on this laptop {seen.zenoh}"
            yield Finding("router", "note", text, remedies.UPDATE)


def robot(seen: Observation, name: str) -> Iterator[Finding]:
    """Report a robot without any service, while other robots are at the same router."""
    if not seen.instances and seen.others:
        text = f"no service of robot {name} is here; the router knows {', '.join(seen.others)}"
        yield Finding("robot", "wrong", text, remedies.NO_ROBOT)


def services(seen: Observation) -> Iterator[Finding]:
    """Report services that are missing, duplicate or hang."""
    healths = seen.health()
    for name in sorted({*NEEDED, *seen.instances}):
        count, health = seen.instances.get(name, 0), healths.get(name)
        if not count:
            yield Finding("services", "wrong", f"{name} is not running", remedies.START)
        elif count > 1 and name in NEEDED:
            yield Finding("services", "wrong", f"{name} is running {count} times", remedies.TWICE)
        elif not health:
            text = f"{name} is running and publishes no health: it hangs"
            yield Finding("services", "wrong", text, remedies.HANGS)
        elif health.lateness > LATE_S:
            text = f"{name} stalls for up to {health.lateness:.2f} s"
            yield Finding("services", "note", text, remedies.STALLS)
        else:
            yield Finding("services", "ok", f"{name} is up for {health.uptime:.0f} s")


def versions(seen: Observation) -> Iterator[Finding]:
    """Report different versions on robot and laptop."""
    healths = seen.health()
    other = {name: h.version for name, h in healths.items() if h.version != seen.t2}
    for name, version in sorted(other.items()):
        text = f"{name} is T2 {version}, this laptop {seen.t2}"
        yield Finding("versions", "note", text, remedies.UPDATE)
    if healths and not other:
        yield Finding("versions", "ok", f"T2 {seen.t2} everywhere")
    for path, reason in sorted(seen.undecodable.items()):
        yield Finding("versions", "wrong", f"{path}: {reason}", remedies.UNDECODABLE)


def rights(seen: Observation) -> Iterator[Finding]:
    """Report what the router allows this laptop to do."""
    if not seen.instances:
        text = "no service found, or the router's list lacks this certificate"
        yield Finding("rights", "unknown", text)
        return
    if not seen.rates:
        yield Finding("rights", "wrong", "services run, but no message arrives", remedies.BLIND)
        return
    allowed = {"driving": seen.may_drive, "calls": seen.may_call}
    barred = [name for name, may in allowed.items() if may is False]
    if barred:
        text = f"this laptop may read; safety does not receive its {' and '.join(barred)}"
        yield Finding("rights", "note", text, remedies.RIGHTS)
    elif None in allowed.values():
        yield Finding("rights", "unknown", "driving and calls require safety")
    else:
        yield Finding("rights", "ok", "this laptop may read, call and drive")


def clock(seen: Observation) -> Iterator[Finding]:
    """Report clock offset and delay variation."""
    if not seen.delays_s:
        yield Finding("clock", "unknown", "no message arrived")
        return
    least, most = min(seen.delays_s), max(seen.delays_s)
    if most - least > SPREAD_S:
        text = f"messages take up to {most - least:.2f} s longer than the fastest"
        yield Finding("clock", "note", text, remedies.SLOW_LINK)
    if seen.one_clock:
        yield Finding("clock", "ok", "the robot runs on this host")
    elif abs(least) > CLOCK_S:
        side = "behind" if least < 0 else "ahead of"
        text = f"this laptop's clock is {abs(least):.1f} s {side} the robot's"
        yield Finding("clock", "note", text, remedies.CLOCK)
    else:
        yield Finding("clock", "ok", f"clocks agree to {abs(least) * 1000:.0f} ms")


def diagnose_bus(seen: Observation) -> Iterator[Finding]:
    """Return all findings between the router and the services."""
    for check in (router, services, versions, rights, clock):
        yield from check(seen)
