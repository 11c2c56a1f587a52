"""All eight sonars: each new sample to each of them, and none when the stream dries up."""

from msgspec import Struct

from common.freshness import Latest, S, fresh
from common.messages import SONAR_NAMES, Ultrasonic
from services.safety.latches import Token
from services.safety.sonar import Rules, Sonar, read
from services.safety.twist import STILL, Twist
from services.safety.zones import Zones

SILENT = tuple(Sonar() for _ in SONAR_NAMES)
LONGEST_STEP_S = 0.3  # between two samples; over longer gaps the motion is unknown


class Heard(Struct, frozen=True):
    """The sonars in the manual's order, and the sample that they know."""

    sonars: tuple[Sonar, ...] = SILENT
    token: Token | None = None
    at_ns: int = 0

    @property
    def distances(self) -> tuple[float, ...]:
        """Metres that are surely free in front of each sonar."""
        return tuple(sonar.distance for sonar in self.sonars)

    @property
    def faults(self) -> str:
        """Name those that cannot be trusted, with the reason; empty when all can."""
        pairs = zip(SONAR_NAMES, self.sonars, strict=True)
        bad = [(name.replace("_", " "), sonar.fault) for name, sonar in pairs if sonar.fault]
        if len(bad) == len(SONAR_NAMES) and len({fault for _, fault in bad}) == 1:
            return f"all {bad[0][1]}"
        return ", ".join(f"{name} {fault}" for name, fault in bad)


class Ears(Struct, frozen=True):
    """How samples are taken in."""

    zones: Zones
    rules: Rules
    age_s: float  # an older sample is worth nothing

    def hear(
        self,
        heard: Heard,
        latest: Latest[Ultrasonic] | None,
        measured: Twist | None,
        now_ns: int,
    ) -> Heard:
        """Take the newest sample in, once."""
        if latest is None or not fresh(latest, now_ns, self.age_s):
            return Heard(SILENT, heard.token, heard.at_ns)
        sample = latest.value
        token = (sample.boot, sample.seq)
        if token == heard.token:
            return heard
        step_s = min((latest.received_ns - heard.at_ns) / S, LONGEST_STEP_S)
        sonars = tuple(
            read(sonar, one, status, self._moved(n, measured, step_s), self.rules)
            for n, (sonar, one, status) in enumerate(
                zip(heard.sonars, sample.ranges, sample.status, strict=True)
            )
        )
        return Heard(sonars, token, latest.received_ns)

    def _moved(self, sonar: int, measured: Twist | None, step_s: float) -> float:
        return self.zones.approach(sonar, measured or STILL) * step_s
