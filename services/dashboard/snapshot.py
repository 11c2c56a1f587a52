"""Snapshots of one robot: the state that the browsers show, made from its telemetry.

Two snapshots are sent to the browsers as JSON, each encoded once for all viewers:
``FastSnapshot``, 20 times a second, and ``SlowSnapshot``, twice a second. None and empty mean that
there is no fresh message. Distances are metres, angles radians, times seconds.
"""

from collections.abc import Mapping
from typing import Literal

from msgspec import Struct

from common.pose import Covariance
from common.root_cause import RootCause, root_cause
from common.text import line
from services.dashboard.driver_lock import HoldState
from services.dashboard.i18n import Texts, phrase, rendered
from services.dashboard.patrol import PatrolView, patrol_view
from services.dashboard.pictures import CameraView
from services.dashboard.telemetry_cache import TelemetryCache
from t2 import keys
from t2.messages import (
    SONAR_NAMES,
    Action,
    Cause,
    CauseName,
    Driver,
    Health,
    Limits,
    MapPose,
    MapState,
    Phrase,
    Phrases,
    RangeStatus,
    Release,
    SafetyState,
    Switches,
    Ultrasonic,
    Verdict,
)

Tone = Literal["dark", "clear", "slow", "stop", "fault"]  # of a sonar sector
WORST: tuple[Tone, ...] = ("dark", "clear", "slow", "stop", "fault")
OF_STATUS: dict[RangeStatus, Tone] = {"no_echo": "clear", "too_near": "stop", "fault": "fault"}
CLOSE_M, NEAR_M = 0.25, 0.5  # readings that are red and amber, also while the vehicle stands
OF_CAUSE: dict[CauseName, Tone] = {"obstacle": "slow", "blocked": "stop"}
SIGMAS = 2.0  # of the drawn ellipse
YOU = Phrase("control.you")


class DriverState(Struct, frozen=True):
    """The viewer with the driver lock, its hold, and whether this dashboard may drive at all."""

    id: str | None
    name: str  # of its operator, as typed; may be empty
    hold: HoldState
    gear: int
    in_sight: bool  # it sees the vehicle, and drives without a picture
    other: str | None  # another source that drives
    overruled: bool  # by that one, during a hold
    may: bool  # false: the router drops the requests of this certificate
    may_stop: bool  # false: its emergency stops, too


class CauseView(Struct, frozen=True):
    """A cause of safety, with its texts."""

    name: CauseName
    action: Action
    age: float
    text: Texts


class SafetyView(Struct, frozen=True):
    """The state of safety, with its texts."""

    verdict: Verdict
    latched: tuple[CauseName, ...]
    causes: tuple[CauseView, ...]
    source: str | None
    limits: Limits
    heartbeat: int
    text: Texts
    own_text: Texts  # the same, for the viewer that is in control
    stopped_by: Texts | None  # who requested the emergency stop that is latched
    release: Release | None
    release_refusal: Texts | None


class MapView(Struct, frozen=True):
    """The pose in the map, with its text; the page draws in ``odom``."""

    state: MapState
    text: Texts
    pose: tuple[float, ...] | None  # x, y and heading in the map
    ellipse: tuple[float, ...] | None  # half axes of two standard deviations; direction in ``odom``
    odom: tuple[float, ...] | None  # x, y and heading of the origin of ``odom`` in the map


class FastSnapshot(Struct, frozen=True, tag_field="k", tag="fast"):
    """The values that change with the motion."""

    connected: bool  # to a router
    root: RootCause
    measured: tuple[float, ...] | None  # linear and angular, as the next two
    requested: tuple[float, ...] | None
    allowed: tuple[float, ...] | None
    pose: tuple[float, ...] | None  # x, y and heading
    epoch: int
    ranges: tuple[float | None, ...]
    tones: tuple[Tone, ...]
    bumper: bool | None
    link: str | None
    safety: SafetyView | None
    driver: DriverState
    keeper: str | None  # the viewer whose page keeps the emergency stop alive


class SlowSnapshot(Struct, frozen=True, tag_field="k", tag="slow"):
    """The values that change rarely."""

    robots: dict[str, bool]  # whether any of its services is alive
    viewers: int
    instances: dict[str, int]  # liveliness tokens of each service
    health: dict[str, Health]  # of the services that publish it
    left: Driver | None
    right: Driver | None
    switches: Switches | None
    map: MapView | None
    patrol: PatrolView | None  # None: the robot has none
    cameras: tuple[CameraView, ...]


def fast_snapshot(
    telemetry: TelemetryCache,
    driver: DriverState,
    now_ns: int,
    *,
    connected: bool,
    keeper: str | None = None,
) -> FastSnapshot:
    """Return the fast snapshot at this time."""
    velocity = telemetry.newest(keys.VELOCITY, now_ns)
    odometry = telemetry.newest(keys.ODOMETRY, now_ns)
    sonar = telemetry.newest(keys.ULTRASONIC, now_ns)
    bumper = telemetry.newest(keys.BUMPER, now_ns)
    motion = telemetry.newest(keys.MOTION, now_ns)
    link = telemetry.newest(keys.LINK, now_ns)
    state = telemetry.newest(keys.SAFETY, now_ns)
    drive = (
        telemetry.newest(keys.DRIVE, now_ns, source=state.source)
        if state and state.source
        else None
    )
    return FastSnapshot(
        connected=connected,
        root=root_cause(connected, state, link),
        measured=(velocity.linear, velocity.angular) if velocity else None,
        requested=(drive.linear, drive.angular) if drive else None,
        allowed=(motion.linear, motion.angular) if motion else None,
        pose=(odometry.x, odometry.y, odometry.heading) if odometry else None,
        epoch=odometry.epoch if odometry else 0,
        ranges=sonar.ranges if sonar else (None,) * 8,
        tones=tones(sonar, state),
        bumper=bumper.pressed if bumper else None,
        link=link.state if link else None,
        safety=safety_view(state, telemetry.stopped_by(state)) if state else None,
        driver=driver,
        keeper=keeper,
    )


def slow_snapshot(
    telemetry: TelemetryCache,
    robots: Mapping[str, bool],
    viewers: int,
    now_ns: int,
    *,
    routes: int = 0,
    cameras: tuple[CameraView, ...] = (),
) -> SlowSnapshot:
    """Return the slow snapshot at this time; ``routes`` is the version of the routes."""
    services, pose = telemetry.services(), telemetry.newest(keys.MAP_POSE, now_ns)
    health = {name: telemetry.newest(keys.HEALTH, now_ns, service=name) for name in services}
    return SlowSnapshot(
        robots=dict(robots),
        viewers=viewers,
        instances={name: len(telemetry.alive.get(name, ())) for name in services},
        health={name: one for name, one in health.items() if one},
        left=telemetry.newest(keys.DRIVER, now_ns, side="left"),
        right=telemetry.newest(keys.DRIVER, now_ns, side="right"),
        switches=telemetry.newest(keys.SWITCHES, now_ns),
        map=map_view(pose) if pose else None,
        patrol=patrol_view(telemetry, routes, now_ns),
        cameras=cameras,
    )


def map_view(pose: MapPose) -> MapView:
    """Return the part of a pose in the map that the page shows."""
    text = rendered(pose.phrases, pose.text)
    if pose.x is None or pose.y is None or pose.heading is None:
        return MapView(pose.state, text, None, None, None)
    ellipse, odom = None, pose.odom
    if pose.pose_covariance and odom:
        axis, other, direction = Covariance.of(pose.pose_covariance).ellipse
        ellipse = SIGMAS * axis, SIGMAS * other, direction - odom.heading
    frame = (odom.x, odom.y, odom.heading) if odom else None
    return MapView(pose.state, text, (pose.x, pose.y, pose.heading), ellipse, frame)


def safety_view(state: SafetyState, stopped_by: str | None = None) -> SafetyView:
    """Return the part of a state of safety that the page shows, with who stopped the robot."""
    return SafetyView(
        verdict=state.verdict,
        latched=state.latched,
        causes=tuple(
            CauseView(it.name, it.action, it.age, rendered(it.phrases, it.text))
            for it in state.causes
        ),
        source=line(state.source) if state.source else None,
        limits=state.limits,
        heartbeat=state.heartbeat,
        text=rendered(state.phrases, state.text),
        own_text=rendered(addressed(state.phrases), state.text),
        stopped_by=phrase("estop.by", who=stopped_by) if stopped_by else None,
        release=state.release,
        release_refusal=(
            rendered(state.refusal_phrases, state.release_refusal)
            if state.release_refusal
            else None
        ),
    )


def addressed(phrases: Phrases) -> Phrases:
    """Return the phrases as they are shown to the operator whose source is in control."""
    return tuple(YOU if one.name == "control.of" else one for one in phrases)


def tones(ultrasonic: Ultrasonic | None, state: SafetyState | None) -> tuple[Tone, ...]:
    """Return the tone of each sector, by the sonar's status and by what safety has against it."""
    if ultrasonic is None or state is None:
        return tuple("dark" for _ in SONAR_NAMES)
    own: dict[str, Tone] = {
        name: OF_STATUS.get(status) or of_reading(reading)
        for name, status, reading in zip(
            SONAR_NAMES, ultrasonic.status, ultrasonic.ranges, strict=True
        )
    }
    found = [
        (name, OF_CAUSE[it.name])
        for it in state.causes
        if it.name in OF_CAUSE
        for name in sonars_of(it)
    ]
    for name, tone in [*found, *((name, "fault") for name in state.doubted_sonars)]:
        if name in own:
            own[name] = max(own[name], tone, key=WORST.index)
    return tuple(own.values())


def of_reading(reading: float | None) -> Tone:
    """Return the tone of a distance (m)."""
    if reading is None:
        return "dark"
    return "stop" if reading < CLOSE_M else "slow" if reading < NEAR_M else "clear"


def sonars_of(cause: Cause) -> list[str]:
    """Return the names of the sonars in the phrases of a cause."""
    return [str(one.fields["sonar"]) for one in cause.phrases if "sonar" in one.fields]
