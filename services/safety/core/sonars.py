"""The eight ultrasonic sensors of the vehicle: where they look, and what their samples show.

``sonar.py`` judges each reading; here it gets the motion along the sonar's axis. A constant reading
is plausible while a wall runs alongside: a corner sonar keeps its reading while the flank sonar on
its side sees a surface at the matching distance. The sonars on the flanks look across the driving
direction, so driving straight predicts no change. A measured velocity below the standstill
threshold is noise or bias and does not add up to motion.

**Overrides.** A faulty sonar blocks its sector. An operator can override that: creep into the
sector while holding the controls, after a neutral request made once the fault was shown for a
second (``SonarOverrides``). A hold that began before the fault does not continue without the sonar.
While ultrasonic samples are too old, all sectors are blocked, and the acknowledgements end.
"""

import math
from collections.abc import Collection, Mapping, Sequence

from msgspec import Struct

from common.freshness import NS_PER_S, Latest, fresh
from common.motion import STILL, Twist
from common.settings import Mount, Vehicle, recess, sonar_mounts
from services.safety.core.causes import Token
from services.safety.core.sonar import Moved, Sonar, trusted, updated
from t2.messages import SONAR_NAMES, Ultrasonic

LONGEST_STEP_S = 0.3  # between two samples; over longer gaps the motion is unknown
SHOWN_NS = NS_PER_S  # time for an operator to read the fault
FLANK_OF = {
    "front_left": "left",
    "rear_left": "left",
    "front_right": "right",
    "rear_right": "right",
}
# Flank reading over corner reading of a wall alongside: cos(45 deg) for a narrow cone, more for a
# wide one, and somewhat less for a wall that is not quite parallel.
ALONGSIDE = (0.5, 1.1)
UNSEEN = ("faulty", "silent")  # faults without a reading; "too near" is an obstacle


class Axis(Struct, frozen=True):
    """Axis of a sonar: speed along it (m/s), for each m/s and each rad/s of a twist.

    A sonar sits at (x, y) and looks along its yaw. Under a twist (v, w) that point moves with
    (v - w*y, w*x); the component along the axis is the speed of approach. The sonars on the flanks
    move across their axis, but the corners swing out to both sides when the vehicle turns. So these
    sonars also limit |w| * length / 2.
    """

    linear: float
    angular: float
    swing: float = 0.0  # m from the middle to the corner that swings out to its side; 0 without one
    recess: float = 0.0  # m from the sonar to the hull, in which a reading is no room

    def along(self, twist: Twist) -> float:
        """Return the speed (m/s) of the sonar along its axis."""
        return twist.linear * self.linear + twist.angular * self.angular

    def approach(self, twist: Twist) -> tuple[float, float]:
        """Return the speeds (m/s) at which driving and turning approach what the sonar sees."""
        turning = twist.angular * self.angular
        swinging = abs(twist.angular) * self.swing
        return twist.linear * self.linear, max(turning, swinging) if self.swing else turning


def axes(vehicle: Vehicle) -> tuple[Axis, ...]:
    """Return the axes of a vehicle's sonars, in the manual's order."""
    return tuple(_axis(mount, vehicle) for mount in sonar_mounts(vehicle))


def _axis(mount: Mount, vehicle: Vehicle) -> Axis:
    along, across = math.cos(mount.yaw), math.sin(mount.yaw)
    swing = vehicle.length / 2 if mount.name in ("left", "right") else 0.0
    return Axis(along, mount.x * across - mount.y * along, swing, recess(mount, vehicle))


SILENT = (Sonar(),) * len(SONAR_NAMES)


class SonarOverrides(Struct, frozen=True):
    """Sonars without a reading, and the sources that may creep into their sectors."""

    since: Mapping[int, int] = {}  # sonar: start of its fault, ns
    acknowledged: Mapping[str, frozenset[int]] = {}  # source: sonars that its operator overrides

    def updated(
        self, unseen: Collection[int], neutral: Mapping[str, int], now_ns: int
    ) -> "SonarOverrides":
        """Return the state now; ``neutral``: when operators' sources that request zero did so."""
        since = {sonar: self.since.get(sonar, now_ns) for sonar in unseen}
        acknowledged = {name: sonars & since.keys() for name, sonars in self.acknowledged.items()}
        for name, neutral_ns in neutral.items():
            acknowledged[name] = frozenset(
                sonar for sonar, at_ns in since.items() if neutral_ns - at_ns >= SHOWN_NS
            )
        return SonarOverrides(since, acknowledged)

    def acknowledged_by(self, source: str | None) -> frozenset[int]:
        """Return the sonars toward which this source may creep without a reading."""
        return self.acknowledged.get(source or "", frozenset())


class SonarArray(Struct, frozen=True):
    """The sonars in the manual's order, after the newest sample."""

    sonars: tuple[Sonar, ...] = SILENT
    distances: tuple[float, ...] = (0.0,) * len(SONAR_NAMES)  # m, shown to be free
    cautious: tuple[float, ...] = (0.0,) * len(SONAR_NAMES)  # m, less where a sonar is in doubt
    is_doubted: bool = True  # whether a sonar is not trusted
    token: Token | None = None
    at_ns: int = 0
    unseen: frozenset[int] = frozenset()  # sonars without a reading while samples are fresh

    @classmethod
    def of(
        cls, sonars: tuple[Sonar, ...], creep_room: float, token: Token, at_ns: int
    ) -> "SonarArray":
        """Return the array of these sonars; ``creep_room`` is the distance for the creep speed."""
        return cls(
            sonars,
            distances=tuple(one.distance for one in sonars),
            cautious=tuple(one.cautious(creep_room) for one in sonars),
            is_doubted=any(one.fault or one.suspect for one in sonars),
            token=token,
            at_ns=at_ns,
            unseen=frozenset(n for n, one in enumerate(sonars) if one.fault in UNSEEN),
        )


class SonarFilter(Struct, frozen=True):
    """Settings and geometry with which samples are processed; holds no state."""

    axes: tuple[Axis, ...]
    age_s: float  # limit of a sample's age
    creep_room: float  # m, at which the creep speed is allowed

    def update(
        self,
        array: SonarArray,
        latest: Latest[Ultrasonic] | None,
        measured: Twist | None,
        now_ns: int,
    ) -> SonarArray:
        """Return the array with the newest sample; each sample is processed once."""
        if latest is None or not fresh(latest, now_ns, self.age_s):
            return SonarArray()  # a sample that is too old never becomes fresh again
        sample = latest.value
        token = (sample.boot, sample.seq)
        if token == array.token:
            return array
        moved = STILL if measured is None or measured.is_standing else measured
        step_s = min((latest.received_ns - array.at_ns) / NS_PER_S, LONGEST_STEP_S)
        readings, faults = zip(*map(trusted, sample.ranges, sample.status), strict=True)
        rooms = [max(0.0, readings[n] - axis.recess) for n, axis in enumerate(self.axes)]
        sonars = tuple(
            updated(
                sonar,
                rooms[n],
                faults[n],
                Moved(
                    along=self.axes[n].along(moved) * step_s,
                    turn=moved.angular * step_s,
                    alongside=_is_alongside(n, rooms),
                ),
            )
            for n, sonar in enumerate(array.sonars)
        )
        return SonarArray.of(sonars, self.creep_room, token, latest.received_ns)


def _is_alongside(sonar: int, rooms: Sequence[float]) -> bool:
    """Return whether the flank on its side sees the wall that a corner sonar sees."""
    flank = FLANK_OF.get(SONAR_NAMES[sonar])
    if flank is None:
        return False
    low, high = (share * rooms[sonar] for share in ALONGSIDE)
    return low <= rooms[SONAR_NAMES.index(flank)] <= high
