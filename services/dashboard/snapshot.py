"""What is shown: everything about one robot at one moment, made of what was heard.

Two pictures go to the browsers as JSON, each encoded once for all: ``Now``, 20 times a second, of
what moves; ``Rest``, twice a second, of what does not. None and empty mean that nothing fresh, or
no number, is known. Distances are metres, angles radians, times seconds.
"""

from collections.abc import Mapping

from msgspec import Struct

from common import keys
from common.codec import finite
from common.messages import Cause, Driver, Event, Limits, Link, Release, Switches
from common.settings import Vehicle
from services.dashboard.driver_lock import Grip, Wheel
from services.dashboard.sectors import Protection, Tone, tones, wheel_angles
from services.dashboard.telemetry_cache import Heard


class State(Struct, frozen=True):
    """What safety says."""

    verdict: str
    text: str
    source: str | None
    latched: tuple[str, ...]
    causes: tuple[Cause, ...]
    limits: Limits
    release: Release | None


class Hands(Struct, frozen=True):
    """Who has the wheel of this dashboard, and what the hand does."""

    id: str | None
    name: str
    grip: Grip
    gear: int


class Now(Struct, frozen=True, tag_field="k", tag="now"):
    """What moves."""

    n: int  # the picture's number, which a hold answers to
    connected: bool  # to a router
    measured: tuple[float, ...] | None  # linear and angular, as the next two
    asked: tuple[float, ...] | None
    allowed: tuple[float, ...] | None
    pose: tuple[float, ...] | None  # x, y and heading
    epoch: int
    ranges: tuple[float | None, ...]
    tones: tuple[Tone, ...]
    wheels: tuple[float, ...]
    bumper: bool | None
    link: str | None
    safety: State | None
    hands: Hands


class Service(Struct, frozen=True):
    """A service, as its tokens and its health tell."""

    name: str
    instances: int
    version: str = ""
    uptime: float | None = None
    lateness: float | None = None
    rss: int | None = None
    troubles: dict[str, int] = {}  # its counters that are not zero


class Stream(Struct, frozen=True):
    """A key, how often it comes here and how old its last message is."""

    key: str
    rate: float
    age: float


class Told(Struct, frozen=True):
    """An event."""

    t: float  # s, the sender's wall clock
    service: str
    name: str
    level: str
    text: str


class Rest(Struct, frozen=True, tag_field="k", tag="rest"):
    """What stands still."""

    robots: dict[str, bool]  # whether anything of it is alive
    viewers: dict[str, str]  # names by id
    services: tuple[Service, ...]
    streams: tuple[Stream, ...]
    left: Driver | None
    right: Driver | None
    switches: Switches | None
    link: Link | None
    protection: Protection


def now(
    heard: Heard,
    wheel: Wheel,
    now_ns: int,
    *,
    number: int,
    names: Mapping[str, str],
    connected: bool,
    vehicle: Vehicle,
    protection: Protection,
) -> Now:
    """Return what moves, at this moment."""
    velocity = heard.newest(keys.VELOCITY, now_ns)
    odometry = heard.newest(keys.ODOMETRY, now_ns)
    sonar = heard.newest(keys.ULTRASONIC, now_ns)
    bumper = heard.newest(keys.BUMPER, now_ns)
    motion = heard.newest(keys.MOTION, now_ns)
    link = heard.newest(keys.LINK, now_ns)
    state = _state(heard, now_ns)
    drive = (
        heard.newest(keys.DRIVE, now_ns, source=state.source) if state and state.source else None
    )
    measured = _numbers(velocity.linear, velocity.angular) if velocity else None
    linear, angular = measured or (0.0, 0.0)
    return Now(
        n=number,
        connected=connected,
        measured=measured,
        asked=_numbers(drive.linear, drive.angular) if drive else None,
        allowed=_numbers(motion.linear, motion.angular) if motion else None,
        pose=_numbers(odometry.x, odometry.y, odometry.heading) if odometry else None,
        epoch=odometry.epoch if odometry else 0,
        ranges=tuple(map(_number, sonar.ranges)) if sonar else (None,) * 8,
        tones=tones(sonar, state.causes if state else (), protection),
        wheels=wheel_angles(linear, angular, vehicle),
        bumper=bumper.pressed if bumper else None,
        link=link.state if link else None,
        safety=state,
        hands=Hands(wheel.driver, names.get(wheel.driver or "", ""), wheel.grip, wheel.gear),
    )


def rest(
    heard: Heard,
    robots: Mapping[str, bool],
    names: Mapping[str, str],
    protection: Protection,
    now_ns: int,
) -> Rest:
    """Return what stands still, at this moment."""
    ages = heard.ages_s(now_ns)
    return Rest(
        robots=dict(robots),
        viewers=dict(names),
        services=tuple(_service(heard, name, now_ns) for name in heard.services()),
        streams=tuple(Stream(key, heard.rates.get(key, 0.0), age) for key, age in ages.items()),
        left=heard.newest(keys.DRIVER, now_ns, side="left"),
        right=heard.newest(keys.DRIVER, now_ns, side="right"),
        switches=heard.newest(keys.SWITCHES, now_ns),
        link=heard.newest(keys.LINK, now_ns),
        protection=protection,
    )


def told(heard: Heard) -> list[Told]:
    """Return the events, the newest last."""
    return [Told(line.event.t_ns / 1e9, line.service, *_words(line.event)) for line in heard.events]


def _numbers(*values: float) -> tuple[float, ...] | None:
    return values if finite(*values) else None


def _number(value: float | None) -> float | None:
    return value if value is not None and finite(value) else None


def _words(event: Event) -> tuple[str, str, str]:
    return event.name, event.level, event.text


def _state(heard: Heard, now_ns: int) -> State | None:
    safety = heard.newest(keys.SAFETY, now_ns)
    if safety is None:
        return None
    return State(
        safety.verdict,
        safety.text,
        safety.source,
        safety.latched,
        safety.causes,
        safety.limits,
        safety.release,
    )


def _service(heard: Heard, name: str, now_ns: int) -> Service:
    instances = len(heard.alive.get(name, ()))
    health = heard.newest(keys.HEALTH, now_ns, service=name)
    if health is None:
        return Service(name, instances)
    return Service(
        name,
        instances,
        health.version,
        health.uptime,
        health.lateness,
        health.rss,
        {what: count for what, count in health.counters.items() if count},
    )
