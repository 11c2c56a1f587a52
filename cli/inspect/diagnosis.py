"""Diagnosis of the path from the laptop to the wheels, from an observation of the bus. Pure.

A finding is ``ok``, ``note`` (information, no effect), ``wrong``, or ``unknown`` because an earlier
part of the path is wrong. What follows from an earlier finding is no problem of its own: one cause
gives one remedy, an instruction to the operator.
"""

from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from cli.inspect.findings import PREFIX, REMEDIES, REMEDY, Finding, Level, found, said
from common.root_cause import FROM_LINK
from services.localization.core.fixes import AGREEING
from t2 import keys
from t2.catalogue import CAUSES, NOTHING
from t2.messages import (
    Camera,
    Cause,
    Field,
    FixState,
    Health,
    Link,
    MapPose,
    PatrolState,
    Phrase,
    Relay,
    SafetyState,
)

STREAMS = (keys.VELOCITY, keys.MILEAGE, keys.BUMPER, keys.ULTRASONIC, keys.ODOMETRY)
# Safety's causes that follow from a stream that is not sent.
ANY_STREAM = ("starting", "silent")
FROM_STREAM = {
    keys.BUMPER.path: (*ANY_STREAM, "bumper"),
    keys.ULTRASONIC.path: (*ANY_STREAM, "sonar"),
}
ONCE = (*keys.ON_BOARD, "localization", "patrol")  # for a robot; any number of others may run
ENOUGH = 0.5  # of a stream's rate; below that, safety stops the vehicle
OPTIONAL = ("patrol", "camera")  # the robot may do without
LATE_S = 0.1  # loop lateness that is reported
CLOCK_S = 1.0  # clock offset that is reported
FIX_S = 10.0  # age of the newest fix that is reported
SPREAD_S = 0.2  # delay variation; half of safety's limit for the delay of a request

# Causes of normal operation, with or without a driver.
NORMAL = ("release", "neutral", "obstacle", "blocked", "limit", "limit_stop")


@dataclass(slots=True)
class Observation:
    """Everything that the doctor has observed on the bus; paths are keys below the robot."""

    t2: str  # this laptop's version
    stranger: str = ""  # the certificate of this laptop, if the router answers it nothing
    listed: bool = True  # whether the router has listed the tokens in time
    instances: dict[str, int] = field(default_factory=dict)  # by service, from tokens
    others: list[str] = field(default_factory=list)  # other robots at the same router
    sources: list[str] | None = None  # as which this certificate may drive; None without safety
    limits: list[str] = field(default_factory=list)  # as which it may limit the speed
    calls: list[str] = field(default_factory=list)
    may_stop: bool | None = None  # as it seems
    delays_s: list[float] = field(default_factory=list)  # by both wall clocks
    rates: dict[str, float] = field(default_factory=dict)  # Hz by path
    undecodable: dict[str, str] = field(default_factory=dict)  # reason by path
    healths: dict[str, Health] = field(default_factory=dict)  # the newest by service
    links: list[Link] = field(default_factory=list)
    pose: MapPose | None = None  # the newest
    patrol: PatrolState | None = None  # the newest
    cameras: dict[str, Camera] = field(default_factory=dict)  # the newest state of each
    camera_boots: dict[str, set[int]] = field(default_factory=dict)  # of the programs with a name
    obeys_patrol: bool | None = None  # whether safety has the source; None if unknown
    state: SafetyState | None = None  # the newest

    def is_absent(self, service: str) -> bool:
        """Return whether a service does not run, or hangs."""
        return service not in self.healths or (self.listed and service not in self.instances)

    def sent_hz(self, path: str) -> float:
        """Return the rate at which a stream is sent, by its publisher's health; 0 if unknown."""
        publisher = self.healths.get(path.split("/")[1])
        rates = publisher.rates if publisher else {}
        return next((hz for key, hz in rates.items() if key.endswith(f"/{path}")), 0.0)

    def is_unsent(self, topic: keys.Topic[Any]) -> bool:
        """Return whether a stream does not arrive, because its publisher sends too little."""
        enough_hz = ENOUGH * topic.rate_hz
        return not self.rates.get(topic.path) and self.sent_hz(topic.path) < enough_hz


def diagnose(seen: Observation, robot: str) -> Iterator[Finding]:
    """Return all findings from the services to the wheels, and safety's state last."""
    if seen.stranger:
        yield found("rights", "wrong", "rights.stranger", "stranger", name=seen.stranger)
        return
    if not seen.instances and seen.others:
        others = tuple(seen.others)
        yield found("robot", "wrong", "robot.wrong", "robot", robot=robot, others=others)
        return
    for check in (services, optional, versions, rights, clock):
        yield from check(seen)
    yield from board(seen)
    yield from localization(seen)
    yield from patrol(seen)
    yield from cameras(seen)
    if seen.is_absent("bridge") or any(link.state != "up" for link in seen.links[-1:]):
        yield from safety(seen, FROM_LINK)
    else:
        unsent = [topic.path for topic in STREAMS if seen.is_unsent(topic)]
        yield from safety(seen, {it for path in unsent for it in FROM_STREAM.get(path, ANY_STREAM)})


# --- from the laptop to the services --------------------------------------------------------------


def services(seen: Observation) -> Iterator[Finding]:
    """Report services that are missing, duplicate or hang."""
    absent = tuple(name for name in keys.ON_BOARD if name not in seen.instances)
    form = "_one" if len(absent) == 1 else ""
    if absent and seen.listed:
        yield found("services", "wrong", f"services.absent{form}", "start", names=absent)
    elif absent:
        yield found("services", "unknown", f"services.unlisted{form}", names=absent)
    present = [name for name in keys.ON_BOARD if name in seen.instances]
    for name in (*present, *sorted(seen.instances.keys() - keys.ON_BOARD)):
        count, health = seen.instances[name], seen.healths.get(name)
        about: dict[str, Field] = {"name": name}
        if count > 1 and name in ONCE:
            about["count"] = count
            yield found("services", "wrong", "services.duplicate", "duplicate", **about)
        elif not health and seen.rates:  # without any message see the rights
            yield found("services", "wrong", "services.hangs", "hangs", **about)
        elif health and health.lateness > LATE_S:
            about["lateness"] = health.lateness
            yield found("services", "note", "services.stalls", "stalls", **about)
        elif health:
            yield found("services", "ok", "services.up", uptime=health.uptime, **about)


def optional(seen: Observation) -> Iterator[Finding]:
    """Name the optional services that do not run; one that hangs leaves the bus after seconds."""
    if seen.listed and not seen.is_absent("safety") and "recorder" not in seen.instances:
        yield found("services", "note", "services.no_recorder", "no_recorder")
    absent = tuple(name for name in OPTIONAL if name not in seen.instances)
    if seen.listed and absent and not seen.is_absent("safety"):
        yield found("services", "note", "services.optional", names=absent)


def versions(seen: Observation) -> Iterator[Finding]:
    """Report different versions on robot and laptop."""
    other = {name: h.version for name, h in seen.healths.items() if h.version != seen.t2}
    for name, version in sorted(other.items()):
        about: dict[str, Field] = {"name": name, "version": version, "t2": seen.t2}
        yield found("versions", "note", "versions.other", "update", **about)
    if seen.healths and not other:
        yield found("versions", "ok", "versions.same", t2=seen.t2)
    for path, reason in sorted(seen.undecodable.items()):
        about = {"path": path, "reason": reason}
        yield found("versions", "wrong", "versions.undecodable", "undecodable", **about)


def rights(seen: Observation) -> Iterator[Finding]:
    """Report what the router allows this laptop to do."""
    if not seen.instances:
        yield found("rights", "unknown", "rights.no_service")
    elif not seen.rates:
        yield found("rights", "wrong", "rights.no_message", "no_message")
    elif seen.sources is None:
        yield found("rights", "unknown", "rights.no_safety")
    else:
        yield _granted(seen, seen.sources)


def _granted(seen: Observation, sources: Sequence[str]) -> Finding:
    """Return what safety and the other services receive from this certificate."""
    rights = {"drive": sources, "limit": seen.limits, "call": seen.calls}
    granted = [(what, names) for what, names in rights.items() if names]
    parts = [("read", ()), *granted] if granted else [("only_read", ())]
    if not granted and seen.may_stop:
        parts = [("read_and_stop", ())]
    if seen.may_stop is False:
        parts.append(("not_stop", ()))
    last = len(parts) - 1
    phrases = tuple(
        Phrase(f"{PREFIX}rights.{what}{'_and' if at < last else ''}", {"names": tuple(names)})
        for at, (what, names) in enumerate(parts)
    )
    if granted:
        return Finding("rights", "ok", "rights.granted", phrases)
    return Finding("rights", "note", "rights.none", phrases, (Phrase(f"{REMEDY}role"),))


def clock(seen: Observation) -> Iterator[Finding]:
    """Report clock offset and delay variation."""
    if not seen.delays_s:
        yield found("clock", "unknown", "clock.no_message")
        return
    least, most = min(seen.delays_s), max(seen.delays_s)
    if most - least > SPREAD_S:
        yield found("clock", "note", "clock.delay", "delay", spread=most - least)
    if abs(least) > CLOCK_S:
        side = "clock.behind" if least < 0 else "clock.ahead"
        yield found("clock", "note", side, "clock", offset=abs(least))
    else:
        yield found("clock", "ok", "clock.agree", ms=abs(least) * 1000)


# --- from the bridge to the wheels ----------------------------------------------------------------


def board(seen: Observation) -> Iterator[Finding]:
    """Report everything behind the bridge."""
    if not seen.links:
        yield found("link", "unknown", "link.no_bridge")
        return
    now = seen.links[-1]
    yield from relay(now.relay, seen.t2)
    if now.relay and now.relay.state != "up" and now.state != "up":
        yield found("link", "unknown", "link.no_relay")
        return
    yield from link(now, seen.links[0])
    if now.state != "up":
        yield found("streams", "unknown", "streams.no_board")
        return
    if not now.armed and not _is_unarmed(seen.state):
        why = Phrase(f"{PREFIX}link.not_armed"), *said(now.waiting_phrases, now.waiting)
        yield Finding("link", "note", "link.not_armed", why)
    yield from streams(seen)


def relay(now: Relay | None, t2: str) -> Iterator[Finding]:
    """Report a configured relay; ``t2`` is the version of this laptop."""
    if now is None:
        return
    if now.state != "up":
        yield found("relay", "wrong", f"relay.{now.state}", "relay")
    elif now.braking:
        remedy = f"relay.{now.braking}"
        known = remedy if remedy in REMEDIES else ""
        yield found("relay", "wrong", "relay.brakes", known, reason=now.braking)
    else:
        yield found("relay", "ok", "relay.up", uptime=now.uptime)
    if now.version not in ("", t2):
        yield found("relay", "note", "relay.version", "relay_copy", version=now.version, t2=t2)


def link(now: Link, before: Link) -> Iterator[Finding]:
    """Report the link to the board, with rejected and unsent frames since ``before``."""
    if now.state != "up":
        remedy = "link_never" if now.state == "never" else "board_lost"
        yield found("link", "wrong", f"link.{now.state}", remedy, board=now.board)
        return
    new = {reason: n - before.rejected.get(reason, 0) for reason, n in now.rejected.items()}
    if bad := tuple(f"{n} {reason}" for reason, n in new.items() if n > 0):
        yield found("link", "note", "link.rejects", "frames", counts=bad)
    if (unsent := now.send_errors - before.send_errors) > 0:
        yield found("link", "wrong", "link.unsent", "unsent", count=unsent)
    if now.round_trip is None:
        yield found("link", "ok", "link.up", board=now.board)
    else:
        yield found("link", "ok", "link.answers", board=now.board, ms=now.round_trip * 1000)


def _is_unarmed(state: SafetyState | None) -> bool:
    """Return whether safety gives the reason why the bridge is not armed."""
    return state is not None and any(cause.name == "unarmed" for cause in state.causes)


def streams(seen: Observation) -> Iterator[Finding]:
    """Report streams that are slow at their publisher, or do not arrive here.

    A router downsamples streams for laptops, so their rate here is no evidence.
    """
    for topic in STREAMS:
        if seen.is_absent(topic.path.split("/")[1]):
            continue
        rate, sent_hz = seen.rates.get(topic.path, 0.0), seen.sent_hz(topic.path)
        if max(rate, sent_hz) < ENOUGH * topic.rate_hz:
            level: Level = "wrong" if seen.is_unsent(topic) else "note"
            about: dict[str, Field] = {"rate": rate, "expected": topic.rate_hz}
            yield found("streams", level, "streams.slow", "silent", path=topic.path, **about)
        elif not rate:
            about = {"path": topic.path, "hz": sent_hz}
            yield found("network", "wrong", "network.dropped", "dropped", **about)


# --- the pose in the map, and safety ----------------------------------------------------------


def localization(seen: Observation) -> Iterator[Finding]:
    """Report the pose in the map; a robot that does not drive in the map needs none."""
    pose = seen.pose
    if pose is None:
        if seen.is_unsent(keys.ODOMETRY):
            return  # the pose follows from odometry
        if "localization" in seen.instances:
            yield found("map", "unknown", "map.no_pose")
        elif seen.listed:
            yield found("map", "note", "map.absent", "localization")
        return
    levels: dict[str, Level] = {"placed": "ok", "unplaced": "note", "lost": "wrong"}
    todo = () if pose.state == "placed" else (Phrase(f"{REMEDY}place"),)
    text = said(pose.phrases, pose.text)
    yield Finding("map", levels[pose.state], f"map.{pose.state}", text, todo)
    for source in pose.sources:
        yield _fixes(source, pose)


def _fixes(of: FixState, pose: MapPose) -> Finding:
    """Return the state of a source of fixes."""
    name: dict[str, Field] = {"source": of.source}
    if of.age is None:
        return found("map", "note", "map.never", "fixes", **name)
    if of.age > FIX_S:
        return found("map", "note", "map.silent", "fixes", age=of.age, **name)
    if not of.in_a_row:
        return found("map", "ok", "map.fixes", used=of.used, refused=of.refused, **name)
    # Refusals of a vehicle that is not placed, or lost by them, follow from that.
    is_faulty = pose.state == "placed" and of.in_a_row >= AGREEING
    refused = Phrase(f"{PREFIX}map.refused", {"count": of.in_a_row, **name})
    phrases = refused, *said(of.phrases, of.text)
    return Finding("map", "wrong" if is_faulty else "note", "map.refused", phrases)


def patrol(seen: Observation) -> Iterator[Finding]:
    """Report a round that needs a person; a robot that drives no rounds needs no patrol."""
    state = seen.patrol
    if state is None:
        return
    if seen.obeys_patrol is False:
        yield found("patrol", "note", "patrol.unknown_source", "patrol_source")
    text = said(state.phrases, state.text)
    if state.state == "stopped":
        yield Finding("patrol", "wrong", "patrol.stopped", text)
    elif state.state == "waiting" and state.left == 0.0:  # the patience is over
        yield Finding("patrol", "note", "patrol.blocked", text)


def cameras(seen: Observation) -> Iterator[Finding]:
    """Report each camera, and why it has no picture."""
    for camera, it in sorted(seen.cameras.items()):
        if len(seen.camera_boots.get(camera, ())) > 1:
            yield found("camera", "wrong", "camera.twice", "camera_twice", name=camera)
            continue
        text, name = said(it.phrases, it.text), f"camera.{it.state}"
        if it.state == "up":
            yield Finding("camera", "ok", name, text)
        else:
            remedy = (Phrase(f"{REMEDY}camera_{it.state}"),)
            yield Finding("camera", "wrong", name, text, remedy)


def safety(seen: Observation, following: Container[str] = ()) -> Iterator[Finding]:
    """Report the causes in safety's state, with safety's texts; it judges the sensors.

    Those that are ``following`` from an earlier finding are folded into one note.
    """
    state = seen.state
    if state is None:
        yield found("safety", "unknown", "safety.no_state")
        return
    folded = [cause for cause in state.causes if cause.name in following]
    if folded:
        texts = (phrase for cause in folded for phrase in said(cause.phrases, cause.text))
        follows = Phrase(f"{PREFIX}safety.follows"), *texts
        yield Finding("safety", "note", "safety.follows", follows)
    for cause in state.causes:
        if cause.name not in following:
            yield _cause(cause, state)
    if not state.causes:
        yield Finding("safety", "ok", "safety.state", said(state.phrases, state.text))


def _cause(cause: Cause, state: SafetyState) -> Finding:
    is_latched = cause.name in state.latched
    level: Level = "note" if cause.name in NORMAL else "wrong"
    if cause.name == "no_request":
        level = "ok"
    remedy, entry = "", CAUSES.get(cause.name)
    if entry and entry.remedy != NOTHING:
        remedy = f"cause.{cause.name}"
    elif is_latched:
        remedy = "reset"
    if cause.name == "contact" and state.release and not state.release.left:
        remedy = "by_hand"
    held = Phrase(f"{PREFIX}safety.{cause.action}{'_latched' * is_latched}")
    phrases = *said(cause.phrases, cause.text), held
    todo = (Phrase(REMEDY + remedy),) if remedy else ()
    return Finding("safety", level, f"cause.{cause.name}", phrases, todo)
