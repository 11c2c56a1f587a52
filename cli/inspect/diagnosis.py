"""Diagnosis of the path from the laptop to the wheels, from an observation of the bus. Pure.

A finding is ``ok``, ``note`` (information, no effect), ``wrong``, or ``unknown`` because an earlier
part of the path is wrong. What follows from an earlier finding is no problem of its own: one cause
gives one remedy, an instruction to the operator.
"""

from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from common.root_cause import FROM_LINK
from t2 import keys
from t2.messages import Health, Link, Relay, SafetyState

Level = Literal["ok", "note", "wrong", "unknown"]

STREAMS = (keys.VELOCITY, keys.MILEAGE, keys.BUMPER, keys.ULTRASONIC, keys.ODOMETRY)
# Safety's causes that follow from a stream that is not sent.
ANY_STREAM = ("starting", "silent")
FROM_STREAM = {
    keys.BUMPER.path: (*ANY_STREAM, "bumper", "bumper_lossy"),
    keys.ULTRASONIC.path: (*ANY_STREAM, "sonar"),
}
ENOUGH = 0.5  # of a stream's rate; below that, safety stops the vehicle
LATE_S = 0.1  # loop lateness that is reported
CLOCK_S = 1.0  # clock offset that is reported
SPREAD_S = 0.2  # delay variation; half of safety's limit for the delay of a request

START = (
    "on the robot: `t2 up`; beside a running stack `t2 up --only NAME`, with systemd `systemctl "
    "start t2-NAME`; if its process exists, it hangs: kill it"
)
STRANGER = (
    "copy members.json to the router's computer and restart the router; if `t2 keys list` shows "
    "that it is revoked, use another certificate"
)
UPDATE = "install the same version on both, and restart the robot's services"
SILENT = "the board does not send it: check the board; `t2 hz` shows the rate"
BOARD_LOST = "check the board's power and cable; the link recovers by itself"
RESET = "when it is safe: `t2 call safety/reset`, or R in `t2 drive`"
BUMPER = "free it; if that is impossible: `t2 drive`, hold F or B, away from it; then reset"
DRIVER = (
    "check the wheel (over current), the encoder's cable (encoder) or the battery (under voltage); "
    "switch the vehicle off and on; then reset"
)
LIMIT = "`t2 echo safety/state --field limit_sources` shows who limits, and why"
RELAY = (
    "is the relay on, its service running, and its cable to the PC connected? board.address and "
    "board.relay_port must be the relay's (docs/relay.md); without a relay set relay_port = 0"
)
RELAY_COPY = "copy services/relay of this version to the relay (docs/relay.md)"
RELAY_BRAKES = {
    "start": "it waits for a neutral command: is the bridge running?",
    "silent": "it lost the commands of the PC: check the cable and the load of both computers",
    "hit": "it waits for the bridge's answer to a bumper hit: is the bridge running?",
}
# By the names of safety's causes, where its text does not contain the remedy.
CAUSES = {
    "contact": BUMPER,
    "estop_reader": f"safety had lost the router; {RESET}",
    "estop_keepalive": f"start its pendant, page or `t2 estop --keepalive NAME`; {RESET}",
    "runaway": f"check the wheels and the ground; {RESET}",
    "uncommanded_motion": f"check for a push or a slope; {RESET}",
    "not_stopping": "use the switch on the vehicle; then check its brakes and the ground",
    "driver_left": DRIVER,
    "driver_right": DRIVER,
    "flapping": f"find the input that is intermittent (t2 echo evt/safety); {RESET}",
    "leaving": START,
    "starting": "wait; if it lasts, the board does not send it: check the board",
    "link": BOARD_LOST,
    "switches": """t2 call bridge/switches '{"ultrasonic_brake": true, "bumper_brake": true}'""",
    "bumper": SILENT,
    "bumper_lossy": "check the cable and the board's load: t2 echo tel/bridge/bumper",
    "silent": SILENT,
    "unarmed": "see the link above: the bridge reports what it waits for",
    "limit_stop": f"clear the area; then release the controls and drive; {LIMIT}",
    "limit_silent": "start its program, check its network and certificate; see safety.limits",
    "two_publishers": "stop one of both: `t2 echo '@cmd/**' --json` shows boot and host of each",
    "blocked": "drive another way, or remove the obstacle",
    "limit": LIMIT,
    "sonar": "check the cable of a faulty one, or remove what covers it; it blocks its sector",
}
# Causes of normal operation, with or without a driver.
NORMAL = ("release", "neutral", "obstacle", "blocked", "limit", "limit_stop")


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


def diagnose(seen: Observation, name: str) -> Iterator[Finding]:
    """Return all findings from the services to the wheels, and safety's state last."""
    if seen.stranger:
        text = f"this router does not know {seen.stranger}"
        yield Finding("rights", "wrong", text, STRANGER)
        return
    if not seen.instances and seen.others:
        text = f"no service of robot {name} is here; the router knows {', '.join(seen.others)}"
        todo = "is it switched on, and its stack started? Otherwise correct --robot or robot.id"
        yield Finding("robot", "wrong", text, todo)
        return
    for check in (services, versions, rights, clock):
        yield from check(seen)
    yield from board(seen)
    if seen.is_absent("bridge") or any(link.state != "up" for link in seen.links[-1:]):
        yield from safety(seen, FROM_LINK)
    else:
        unsent = [topic.path for topic in STREAMS if seen.is_unsent(topic)]
        yield from safety(seen, {it for path in unsent for it in FROM_STREAM.get(path, ANY_STREAM)})


# --- from the laptop to the services --------------------------------------------------------------


def services(seen: Observation) -> Iterator[Finding]:
    """Report services that are missing, duplicate or hang."""
    absent = [name for name in keys.ON_BOARD if name not in seen.instances]
    names = f"{', '.join(absent)} {'is' if len(absent) == 1 else 'are'}"
    if absent and seen.listed:
        yield Finding("services", "wrong", f"{names} not running", START)
    elif absent:
        text = f"{names} perhaps running: the router did not list the services in time"
        yield Finding("services", "unknown", text)
    present = [name for name in keys.ON_BOARD if name in seen.instances]
    for name in (*present, *sorted(seen.instances.keys() - keys.ON_BOARD)):
        count, health = seen.instances[name], seen.healths.get(name)
        if count > 1 and name in keys.ON_BOARD:
            todo = "stop one of them: a robot has one of each; look for a second `t2 up`"
            yield Finding("services", "wrong", f"{name} is running {count} times", todo)
        elif not health and seen.rates:  # without any message see the rights
            text = f"{name} is running and publishes no health: it hangs"
            todo = "kill its process; its supervisor restarts it"
            yield Finding("services", "wrong", text, todo)
        elif health and health.lateness > LATE_S:
            text = f"{name} stalls for up to {health.lateness:.2f} s"
            yield Finding("services", "note", text, "find the processes that use its CPU")
        elif health:
            yield Finding("services", "ok", f"{name} is up for {health.uptime:.0f} s")


def versions(seen: Observation) -> Iterator[Finding]:
    """Report different versions on robot and laptop."""
    other = {name: h.version for name, h in seen.healths.items() if h.version != seen.t2}
    for name, version in sorted(other.items()):
        text = f"{name} is T2 {version}, this laptop {seen.t2}"
        yield Finding("versions", "note", text, UPDATE)
    if seen.healths and not other:
        yield Finding("versions", "ok", f"T2 {seen.t2} everywhere")
    for path, reason in sorted(seen.undecodable.items()):
        todo = "a publisher with another version, or a foreign program"
        yield Finding("versions", "wrong", f"{path}: {reason}", todo)


def rights(seen: Observation) -> Iterator[Finding]:
    """Report what the router allows this laptop to do."""
    if not seen.instances:
        yield Finding("rights", "unknown", "no service found")
    elif not seen.rates:
        text = "services run, but no message arrives"
        todo = (
            "the router's access rules do not allow this laptop to read: use another certificate; "
            "if other laptops receive nothing either, all services hang: restart them"
        )
        yield Finding("rights", "wrong", text, todo)
    elif seen.sources is None:
        yield Finding("rights", "unknown", "driving and calls require safety")
    else:
        yield _granted(seen, seen.sources)


def _granted(seen: Observation, sources: Sequence[str]) -> Finding:
    """Return what safety and the other services receive from this certificate."""
    rights = {"drive as": sources, "limit as": seen.limits, "call": seen.calls}
    granted = [f"{what} {', '.join(names)}" for what, names in rights.items() if names]
    text = f"this laptop may {'; '.join(['read', *granted])}"
    if not granted:
        text = "this laptop may read and stop" if seen.may_stop else "this laptop may only read"
    if seen.may_stop is False:
        text += "; as it seems, not stop: use the vehicle's own switch"
    if granted:
        return Finding("rights", "ok", text)
    todo = "`t2 keys list`, where the certificate authority is, shows its certificate's role"
    return Finding("rights", "note", text, todo)


def clock(seen: Observation) -> Iterator[Finding]:
    """Report clock offset and delay variation."""
    if not seen.delays_s:
        yield Finding("clock", "unknown", "no message arrived")
        return
    least, most = min(seen.delays_s), max(seen.delays_s)
    if most - least > SPREAD_S:
        text = f"messages take up to {most - least:.2f} s longer than the fastest"
        todo = "move closer to the access point; safety refuses requests with too high a delay"
        yield Finding("clock", "note", text, todo)
    if abs(least) > CLOCK_S:
        side = "behind" if least < 0 else "ahead of"
        text = f"this laptop's clock is {abs(least):.1f} s {side} the robot's"
        todo = "synchronize both clocks with NTP; driving does not need it, recordings do"
        yield Finding("clock", "note", text, todo)
    else:
        yield Finding("clock", "ok", f"clocks agree to {abs(least) * 1000:.0f} ms")


# --- from the bridge to the wheels ----------------------------------------------------------------


def board(seen: Observation) -> Iterator[Finding]:
    """Report everything behind the bridge."""
    if not seen.links:
        yield Finding("link", "unknown", "no bridge reports the board")
        return
    now = seen.links[-1]
    yield from relay(now.relay, seen.t2)
    if now.relay and now.relay.state != "up" and now.state != "up":
        yield Finding("link", "unknown", "no frame of the board without the relay")
        return
    yield from link(now, seen.links[0])
    if now.state != "up":
        yield Finding("streams", "unknown", "no data without the board")
        return
    yield from streams(seen)


def relay(now: Relay | None, t2: str) -> Iterator[Finding]:
    """Report a configured relay; ``t2`` is the version of this laptop."""
    if now is None:
        return
    if now.state != "up":
        text = "the relay is silent" if now.state == "lost" else "no report of the relay received"
        yield Finding("relay", "wrong", text, RELAY)
    elif now.braking:
        todo = RELAY_BRAKES.get(now.braking, "")
        yield Finding("relay", "wrong", f"the relay sends BRAKE: {now.braking}", todo)
    else:
        yield Finding("relay", "ok", f"the relay passes commands, up for {now.uptime:.0f} s")
    if now.version not in ("", t2):
        text = f"the relay is T2 {now.version}, this laptop {t2}"
        yield Finding("relay", "note", text, RELAY_COPY)


def link(now: Link, before: Link) -> Iterator[Finding]:
    """Report the link to the board, with rejected and unsent frames since ``before``."""
    if now.state == "never":
        todo = (
            "is the board on, its cable connected, and this robot's address the one that it sends "
            "to (board.listen_address; 10.7.5.220 on the vehicle)?"
        )
        yield Finding("link", "wrong", f"no frame received from the board at {now.board}", todo)
        return
    if now.state == "lost":
        yield Finding("link", "wrong", f"the board at {now.board} is silent", BOARD_LOST)
        return
    new = {reason: n - before.rejected.get(reason, 0) for reason, n in now.rejected.items()}
    if bad := ", ".join(f"{n} {reason}" for reason, n in new.items() if n > 0):
        text = f"the bridge rejects frames of the board: {bad}"
        todo = "`t2 wire decode` shows the invalid frames"
        yield Finding("link", "note", text, todo)
    if (unsent := now.send_errors - before.send_errors) > 0:
        text = f"the system failed to send {unsent} datagrams to the board"
        todo = "check the robot's network interface, its firewall and board.address"
        yield Finding("link", "wrong", text, todo)
    round_trip = "" if now.round_trip is None else f", answers in {now.round_trip * 1000:.1f} ms"
    yield Finding("link", "ok", f"the board at {now.board} is up{round_trip}")
    if not now.armed:
        yield Finding("link", "note", f"the bridge accepts no motion now: {now.waiting}")


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
            text = f"{topic.path} has {rate:.0f} of {topic.rate_hz:g} Hz"
            yield Finding("streams", level, text, SILENT)
        elif not rate:
            text = f"{topic.path} is sent with {sent_hz:.0f} Hz and does not arrive here"
            todo = "the network or the router drops it: move closer to the access point"
            yield Finding("network", "wrong", text, todo)


def safety(seen: Observation, following: Container[str] = ()) -> Iterator[Finding]:
    """Report the causes in safety's state, with safety's texts; it judges the sensors.

    Those that are ``following`` from an earlier finding are folded into one note.
    """
    state = seen.state
    if state is None:
        yield Finding("safety", "unknown", "safety publishes no state")
        return
    folded = [cause.text for cause in state.causes if cause.name in following]
    if folded:
        text = f"follows from the above: {' '.join(folded)}"
        yield Finding("safety", "note", text)
    for cause in state.causes:
        if cause.name in following:
            continue
        latched = cause.name in state.latched
        level: Level = "note" if cause.name in NORMAL else "wrong"
        if cause.name == "no_request":
            level = "ok"
        todo = CAUSES.get(cause.name, RESET if latched else "")
        if cause.name == "contact" and state.release and not state.release.left:
            todo = "push the vehicle off by hand; then reset"
        text = f"{cause.text} ({cause.action}{', latched' * latched})"
        yield Finding("safety", level, text, todo)
    if not state.causes:
        yield Finding("safety", "ok", state.text)
