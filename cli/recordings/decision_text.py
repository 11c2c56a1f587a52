"""Texts of a replayed decision: inputs with ages and limits, causes, rules, plan. Pure."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from cli.recordings.decision_replay import Decided
from common.freshness import NS_PER_S, Latest
from common.motion import RUN, STILL, Twist
from services.safety.config import SafetyConfig
from services.safety.core.causes import BY_NAME, Clears, ordered
from services.safety.core.planning import Planner
from services.safety.core.speed_limits import LimitChannel
from services.safety.report import described
from t2.catalogue import CAUSES
from t2.messages import (
    SONAR_NAMES,
    Bumper,
    CauseName,
    Driver,
    Link,
    Message,
    Mileage,
    Motion,
    SafetyState,
    Switches,
    Ultrasonic,
    Velocity,
)
from t2.words import Language, in_language, render

CLEARS = {
    Clears.RESET: "latched until a reset, then a neutral request",
    Clears.SETTLED: "until 0.5 s without the cause, then a neutral request",
    Clears.NEUTRAL: "until the cause ends, then a neutral request",
    Clears.AT_ONCE: "until the cause ends",
}
# The inputs that show a cause, by the beginning of their names. Of "starting" and "silent" only
# those that are missing or too old.
SHOWN_BY: dict[CauseName, tuple[str, ...]] = {
    "contact": ("bumper",),
    "estop": ("estop key", "link"),
    "estop_reader": ("estop path",),
    "estop_keepalive": ("limit",),
    "predecessor": ("link",),
    "runaway": ("velocity",),
    "uncommanded_motion": ("velocity", "mileage"),
    "not_stopping": ("velocity",),
    "driver_left": ("driver left",),
    "driver_right": ("driver right",),
    "starting": ("",),
    "link": ("link",),
    "switches": ("switches",),
    "bumper": ("bumper",),
    "silent": ("",),
    "unarmed": ("link",),
    "limit_stop": ("limit",),
    "limit_silent": ("limit",),
    "two_publishers": ("drive ", "limit"),
    "neutral": ("drive ",),
    "blocked": ("ultrasonic",),
    "no_request": ("drive ",),
    "limit": ("limit",),
    "obstacle": ("ultrasonic",),
    "sonar": ("ultrasonic",),
}


@dataclass(frozen=True, slots=True)
class Input:
    """One input of a decision; None: never received, or without an age or a limit (s)."""

    name: str
    value: str
    age_s: float | None = None
    limit_s: float | None = None

    @property
    def is_late(self) -> bool:
        """Whether it is older than its limit."""
        return self.age_s is not None and self.limit_s is not None and self.age_s > self.limit_s

    def __str__(self) -> str:
        if self.age_s is None:
            return f"{self.name}: {self.value}"
        limit = "" if self.limit_s is None else f", limit {self.limit_s:.2f} s"
        late = ", TOO OLD" if self.is_late else ""
        return f"{self.name}: {self.value}, {self.age_s:.3f} s old{limit}{late}"


def inputs(decided: Decided, settings: SafetyConfig) -> list[Input]:
    """Return all inputs of a decision: measurements, emergency stop, requests, speed limits."""
    return [*_measurements(decided, settings), *_requests(decided)]


def _measurements(decided: Decided, settings: SafetyConfig) -> Iterator[Input]:
    taken, times, now_ns = decided.inputs, settings.times, decided.at_ns
    streams: tuple[tuple[str, Latest[Any] | None, float | None], ...] = (
        ("velocity", taken.velocity, times.velocity_age),
        ("mileage", taken.mileage, None),
        ("ultrasonic", taken.ultrasonic, times.ultrasonic_age),
        ("bumper", taken.bumper, times.bumper_age),
        ("driver left", taken.left, times.driver_age),
        ("driver right", taken.right, times.driver_age),
        ("switches", taken.switches, _of(times.switches_age, settings.board.require_switches)),
        ("link", taken.link, times.link_age),
        ("estop path", taken.estop_path, times.estop_path_age),
    )
    for name, latest, limit_s in streams:
        if latest is None:
            yield Input(name, "not received", None, limit_s)
        else:
            yield Input(
                name, VALUES[type(latest.value)](latest.value), latest.age_s(now_ns), limit_s
            )
    yield Input("estop key", "received" if taken.estop else "nothing received")


def _of(limit_s: float, is_needed: bool) -> float | None:
    return limit_s if is_needed else None


def _requests(decided: Decided) -> Iterator[Input]:
    """Yield the newest accepted request and speed limit of each source."""
    arbiter, limits, now_ns = decided.state.arbiter, decided.state.speed_limits, decided.at_ns
    for name, source in arbiter.sources.items():
        if channel := arbiter.channels.get(name):
            asked = speed(channel.requested)
            if channel.release != "none":
                asked = f"release {channel.release}"
            due = "" if arbiter.is_neutral(name) else " (a neutral request is due)"
            yield Input(f"drive {name}", asked + due, channel.age_s(now_ns), source.lease)
    for name, limit in limits.sources.items():
        if cap := limits.channels.get(name):
            yield Input(f"limit {name}", _caps(cap) + cap.because, cap.age_s(now_ns), limit.lease)
        else:
            yield Input(f"limit {name}", "not received", None, limit.lease)


def _caps(limit: LimitChannel) -> str:
    caps = ((limit.linear, "m/s"), (limit.angular, "rad/s"))
    return ", ".join(f"{cap:g} {unit}" for cap, unit in caps if math.isfinite(cap)) or "no cap"


def _ranges(sample: Ultrasonic) -> str:
    readings = zip(SONAR_NAMES, sample.ranges, sample.status, strict=True)
    return ", ".join(f"{name} {_range(far, status)}" for name, far, status in readings)


def _range(far: float | None, status: str) -> str:
    return status if far is None else f"{far:.2f} m"


def _faults(sample: Driver) -> str:
    bits = f"bits {sample.bits:#x}" if sample.bits else "no fault"
    return ", ".join(sample.faults) or bits


def _link(link: Link) -> str:
    parts = [link.state, "armed" if link.armed else f"not armed: {link.waiting}"]
    if link.estop is not None:
        parts.append("emergency stop to be latched")
    if link.latched_by is not None:
        parts.append(f"latched by {link.latched_by:x}")
    return ", ".join(parts)


def speed(twist: Twist) -> str:
    """Return a twist as text."""
    return f"{twist.linear:z.3f} m/s, {twist.angular:z.3f} rad/s"


VALUES: dict[type[Message], Callable[[Any], str]] = {
    Velocity: lambda it: speed(Twist(it.linear, it.angular)),
    Mileage: lambda it: f"{it.distance:.3f} m, {it.heading:.3f} rad",
    Ultrasonic: _ranges,
    Bumper: lambda it: "pressed" if it.pressed else "free",
    Driver: _faults,
    Switches: lambda it: f"ultrasonic {it.ultrasonic_brake}, bumper {it.bumper_brake}",
    Link: _link,
    SafetyState: lambda it: f"heartbeat {it.heartbeat}",
}


def motion_text(motion: Motion) -> str:
    """Return a motion as text; only RUN has a speed."""
    if motion.command is not RUN:
        return motion.command.upper()
    return f"RUN {speed(Twist(motion.linear, motion.angular))}"


def difference_text(decided: Decided) -> str:
    """Return both motions, and what differs besides command and speed."""
    others = [name for name in decided.differences if name not in ("command", "linear", "angular")]
    recorded, replayed = (
        ", ".join([motion_text(motion), *(f"{name} {getattr(motion, name)}" for name in others)])
        for motion in (decided.recorded, decided.motion)
    )
    return f"recorded {recorded}; replayed {replayed}"


def cause_text(decided: Decided, name: CauseName, language: Language) -> str:
    """Return the text of a held cause, as the screens show it."""
    title = in_language(CAUSES[name].text, language)
    return render(described(decided.state, name), language, title)


def rule(name: CauseName) -> str:
    """Return what safety does on a cause, and until when."""
    return f"{BY_NAME[name].action.upper()} {CLEARS[BY_NAME[name].clears]}"


def shown_by(decided: Decided, name: CauseName, settings: SafetyConfig) -> list[Input]:
    """Return the inputs that show a cause."""
    prefixes = SHOWN_BY.get(name, ())
    found = [one for one in inputs(decided, settings) if one.name.startswith(prefixes)]
    if name == "silent":
        return [one for one in found if one.is_late]
    sonar = decided.state.verdict.blocked_by
    if name == "blocked" and sonar is not None:
        return [_one_sonar(each, decided, sonar) for each in found]
    if name == "estop" and decided.inputs.estop:
        return [one for one in found if one.name == "estop key"]
    if name == "starting":
        return [one for one in found if one.value == "not received"]
    return found


def _one_sonar(one: Input, decided: Decided, sonar: int) -> Input:
    """Return the input of all sonars with the reading of one."""
    if decided.inputs.ultrasonic is None:
        return one
    sample = decided.inputs.ultrasonic.value
    value = f"{SONAR_NAMES[sonar]} {_range(sample.ranges[sonar], sample.status[sonar])}"
    return Input(one.name, value, one.age_s, one.limit_s)


def zone(decided: Decided, planner: Planner, settings: SafetyConfig) -> str:
    """Return what the sonar that blocks or slows the request allows, and why; empty without."""
    verdict, state = decided.state.verdict, decided.state
    sonar = verdict.slowed_by if verdict.blocked_by is None else verdict.blocked_by
    requested = planner.requested(state, decided.at_ns)
    if sonar is None or requested is None:
        return ""
    distances = planner.cautious(state, requested.source)
    allowed = requested.twist.scaled(planner.zones.limit(requested.twist, distances).factor)
    known = decided.inputs.known_velocity(decided.at_ns, settings.times.velocity_age)
    measured = known.value if known else STILL
    return (
        f"sonar {SONAR_NAMES[sonar]} {distances[sonar]:.2f} m from the hull allows "
        f"{speed(allowed)} of the requested {speed(requested.twist)}, measured {speed(measured)}; "
        f"by safety.margin {settings.safety.margin:g} m, a reaction of {settings.reaction:.2f} s "
        f"(safety.react {settings.safety.react:g} s), vehicle.deceleration "
        f"{settings.vehicle.deceleration:g} m/s2, vehicle.angular_deceleration "
        f"{settings.vehicle.angular_deceleration:g} rad/s2"
    )


def held(decided: Decided, language: Language) -> list[Sequence[str]]:
    """Return the held causes as table rows: name, action, since (s), good samples, text."""
    latches = decided.state.latches
    return [
        (
            name,
            BY_NAME[name].action,
            f"{(decided.at_ns - latches[name].since_ns) / NS_PER_S:.2f}",
            str(latches[name].good),
            cause_text(decided, name, language),
        )
        for name in ordered(latches)
    ]
