"""All eight sonars: processes each ultrasonic sample, and invalidates all when the stream is old.

A constant reading is plausible when one of these explains it:

- It is the greatest range of the sensors, which another sonar gives as well (``Saturation``).
- A wall runs alongside: a corner sonar keeps its reading while the flank sonar on its side sees a
  surface at the matching distance.

The sonars on the flanks look across the driving direction, so driving straight predicts no change.
A measured velocity below the standstill threshold is noise or bias and does not add up to motion.

A faulty sonar blocks its sector. An operator can override that: creep into the sector while holding
the controls, after a neutral request made once the fault was shown for a second
(``SonarOverrides``). A hold that began before the fault does not continue without the sonar. While
ultrasonic samples are too old, all sectors are blocked, and the acknowledgements end.
"""

import math
from collections.abc import Collection, Mapping, Sequence

from msgspec import Struct

from common.freshness import NS_PER_S, Latest, fresh
from common.messages import SONAR_NAMES, Ultrasonic
from common.motion import STILL, Twist
from services.safety.latches import Token
from services.safety.sonar import SAME_M, Moved, Rules, Sonar, read
from services.safety.zones import Zones

SILENT = tuple(Sonar() for _ in SONAR_NAMES)
LONGEST_STEP_S = 0.3  # between two samples; over longer gaps the motion is unknown
SHARED_SAMPLES = 20  # a second
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


class Saturation(Struct, frozen=True):
    """The greatest range of the sensors, when they report one instead of "no echo".

    What the real sensors report with nothing in range is unknown. A range counts as the greatest
    one when two sonars share it to the millimetre for a second and none exceeds it. A single frozen
    sonar cannot establish one. An echo of a real surface seldom does; then only that exact value
    counts as explained.
    """

    reading: float | None = None  # m
    candidate: float = 0.0  # m, shared by at least two sonars now
    samples: int = 0  # in a row with that candidate

    def updated(self, readings: Sequence[float]) -> "Saturation":
        """Return the state after one sample of all sonars; infinity: no echo, 0: no reading."""
        top = max(readings)
        known = None if self.reading is not None and top > self.reading + SAME_M else self.reading
        sharing = sum(top - one < SAME_M for one in readings)
        if math.isinf(top) or sharing < 2:
            return Saturation(known)
        if abs(top - self.candidate) >= SAME_M:
            return Saturation(known, top, 1)
        samples = self.samples + 1
        reached = samples >= SHARED_SAMPLES
        return Saturation(self.candidate if reached else known, self.candidate, samples)

    def explains(self, reading: float) -> bool:
        """Return whether a reading is the greatest one."""
        return self.reading is not None and abs(reading - self.reading) < SAME_M


class SonarOverrides(Struct, frozen=True):
    """Sonars without a reading, and the sources that may creep into their sectors."""

    since: Mapping[int, int] = {}  # sonar: start of its fault, ns
    acknowledged: Mapping[str, frozenset[int]] = {}  # source: sonars that its operator overrides

    def updated(
        self, unseen: Collection[int], neutral: Collection[str], now_ns: int
    ) -> "SonarOverrides":
        """Return the state now; ``neutral``: the operators' sources that request zero now."""
        since = {sonar: self.since.get(sonar, now_ns) for sonar in unseen}
        shown = frozenset(sonar for sonar, at_ns in since.items() if now_ns - at_ns >= SHOWN_NS)
        acknowledged = {name: sonars & since.keys() for name, sonars in self.acknowledged.items()}
        for source in neutral:
            acknowledged[source] = acknowledged.get(source, frozenset()) | shown
        return SonarOverrides(since, acknowledged)

    def acknowledged_by(self, source: str | None) -> frozenset[int]:
        """Return the sonars toward which this source may creep without a reading."""
        return self.acknowledged.get(source or "", frozenset())


class SonarArray(Struct, frozen=True):
    """The sonars in the manual's order, and the newest sample processed."""

    sonars: tuple[Sonar, ...] = SILENT
    token: Token | None = None
    at_ns: int = 0
    saturation: Saturation = Saturation()
    distances: tuple[float, ...] = (0.0,) * len(SILENT)  # m that are shown to be free
    cautious: tuple[float, ...] = (0.0,) * len(SILENT)  # m to plan with, less where in doubt
    unseen: frozenset[int] = frozenset()  # sonars without a reading while samples are fresh

    @property
    def faults(self) -> str:
        """Names of the untrusted sonars with the reason; empty when all are trusted."""
        pairs = zip(SONAR_NAMES, self.sonars, strict=True)
        bad = [(name.replace("_", " "), _doubt(sonar)) for name, sonar in pairs if _doubt(sonar)]
        if len(bad) == len(SONAR_NAMES) and len({doubt for _, doubt in bad}) == 1:
            return f"all {bad[0][1]}"
        return ", ".join(f"{name} {doubt}" for name, doubt in bad)


class SonarFilter(Struct, frozen=True):
    """Settings and geometry with which samples are processed; holds no state."""

    zones: Zones
    rules: Rules
    age_s: float  # limit of a sample's age
    creep_room: float  # m that the creep speed needs

    def update(
        self,
        array: SonarArray,
        latest: Latest[Ultrasonic] | None,
        measured: Twist | None,
        now_ns: int,
    ) -> SonarArray:
        """Return the array with the newest sample; each sample is processed once."""
        if latest is None or not fresh(latest, now_ns, self.age_s):
            return SonarArray(SILENT, array.token, array.at_ns, array.saturation)
        sample = latest.value
        token = (sample.boot, sample.seq)
        if token == array.token:
            return array
        moved = STILL if measured is None or measured.is_standing else measured
        step_s = min((latest.received_ns - array.at_ns) / NS_PER_S, LONGEST_STEP_S)
        readings = tuple(map(_shown, sample.ranges, sample.status))
        saturation = array.saturation.updated(readings)
        sonars = tuple(
            read(
                sonar,
                sample.ranges[n],
                sample.status[n],
                Moved(
                    along=self.zones.along(n, moved) * step_s,
                    turn=moved.angular * step_s,
                    beyond=saturation.explains(readings[n]),
                    alongside=_is_alongside(n, readings),
                ),
                self.rules,
            )
            for n, sonar in enumerate(array.sonars)
        )
        return SonarArray(
            sonars,
            token,
            latest.received_ns,
            saturation,
            distances=tuple(sonar.distance for sonar in sonars),
            cautious=tuple(sonar.cautious(self.creep_room) for sonar in sonars),
            unseen=frozenset(n for n, sonar in enumerate(sonars) if sonar.is_unseen),
        )


def _shown(reading: float | None, status: str) -> float:
    """Return the range of a sample; infinity for no echo, 0 for no reading."""
    if status == "no_echo":
        return math.inf
    good = status == "ok" and reading is not None and math.isfinite(reading)
    return reading if good and reading is not None else 0.0


def _is_alongside(sonar: int, readings: tuple[float, ...]) -> bool:
    """Return whether the flank on its side sees the wall that a corner sonar sees."""
    flank = FLANK_OF.get(SONAR_NAMES[sonar])
    if flank is None:
        return False
    low, high = (share * readings[sonar] for share in ALONGSIDE)
    return low <= readings[SONAR_NAMES.index(flank)] <= high


def _doubt(sonar: Sonar) -> str:
    return sonar.fault or ("suspect" if sonar.suspect else "")
