"""All eight sonars: each new sample to each of them, and none when the stream dries up.

A reading that does not change is explained by what its neighbours see:

- the greatest range of the sensors, which another sonar gives as well (``saturation.py``)
- a wall alongside: a corner sonar keeps its reading while the flank on its side sees a surface at
  the distance that fits

The sonars on the flanks look across the way, so that driving straight predicts no change. A
measured velocity below the standstill threshold is noise or bias: it does not add up to a motion.
"""

import math

from msgspec import Struct

from common.freshness import NS_PER_S, Latest, fresh
from common.messages import SONAR_NAMES, Ultrasonic
from common.motion import STILL, Twist
from services.safety.latches import Token
from services.safety.saturation import Saturation
from services.safety.sonar import Moved, Rules, Sonar, read
from services.safety.zones import Zones

SILENT = tuple(Sonar() for _ in SONAR_NAMES)
LONGEST_STEP_S = 0.3  # between two samples; over longer gaps the motion is unknown
FLANK_OF = {
    "front_left": "left",
    "rear_left": "left",
    "front_right": "right",
    "rear_right": "right",
}
# What a flank sees of a wall alongside, by what the corner sonar beside it sees: cos(45 deg) for a
# narrow cone, more for a wide one, and somewhat less for a wall that is not quite parallel.
ALONGSIDE = (0.5, 1.1)


class Heard(Struct, frozen=True):
    """The sonars in the manual's order, and the sample that they know."""

    sonars: tuple[Sonar, ...] = SILENT
    token: Token | None = None
    at_ns: int = 0
    saturation: Saturation = Saturation()
    distances: tuple[float, ...] = (0.0,) * len(SILENT)  # m that are shown to be free
    cautious: tuple[float, ...] = (0.0,) * len(SILENT)  # m to plan with, less where in doubt
    unseen: frozenset[int] = frozenset()  # sonars without a reading while samples are fresh

    @property
    def faults(self) -> str:
        """Name those that cannot be trusted, with the reason; empty when all can."""
        pairs = zip(SONAR_NAMES, self.sonars, strict=True)
        bad = [(name.replace("_", " "), _doubt(sonar)) for name, sonar in pairs if _doubt(sonar)]
        if len(bad) == len(SONAR_NAMES) and len({doubt for _, doubt in bad}) == 1:
            return f"all {bad[0][1]}"
        return ", ".join(f"{name} {doubt}" for name, doubt in bad)


class Ears(Struct, frozen=True):
    """How samples are taken in."""

    zones: Zones
    rules: Rules
    age_s: float  # an older sample is worth nothing
    creep_room: float  # m; what the creep speed needs

    def hear(
        self,
        heard: Heard,
        latest: Latest[Ultrasonic] | None,
        measured: Twist | None,
        now_ns: int,
    ) -> Heard:
        """Take the newest sample in, once."""
        if latest is None or not fresh(latest, now_ns, self.age_s):
            return Heard(SILENT, heard.token, heard.at_ns, heard.saturation)
        sample = latest.value
        token = (sample.boot, sample.seq)
        if token == heard.token:
            return heard
        moved = STILL if measured is None or measured.is_standing else measured
        step_s = min((latest.received_ns - heard.at_ns) / NS_PER_S, LONGEST_STEP_S)
        readings = tuple(map(_shown, sample.ranges, sample.status))
        saturation = heard.saturation.after(readings)
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
            for n, sonar in enumerate(heard.sonars)
        )
        return Heard(
            sonars,
            token,
            latest.received_ns,
            saturation,
            distances=tuple(sonar.distance for sonar in sonars),
            cautious=tuple(sonar.cautious(self.creep_room) for sonar in sonars),
            unseen=frozenset(n for n, sonar in enumerate(sonars) if sonar.is_unseen),
        )


def _shown(reading: float | None, status: str) -> float:
    """Return the range that a sample shows, infinity for no echo, 0 for none."""
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
