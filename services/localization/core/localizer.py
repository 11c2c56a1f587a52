"""Where the vehicle is in the map, by odometry, placements and fixes.

========== ============================================== =====================================
state      begins with                                    ends with
========== ============================================== =====================================
unplaced   the start; a restart of odometry, or a pose    a placement: by an operator, or by
           set in it after a gap                          ``AGREEING`` fixes in a row of a source
                                                          that ``places`` and that agree
placed     a placement; fixes while only the uncertainty  a cause of the two other states
           made it lost
lost       an uncertainty above ``lost_sigma`` or         ``AGREEING`` fixes in a row that agree
           ``lost_heading_sigma``
lost       ``AGREEING`` refused fixes in a row of one     a placement by an operator
           source that agree with each other, while no
           other source confirms the pose
========== ============================================== =====================================

A fix names the odometry sample at which it was measured. Samples and used fixes are kept for 2 s: a
late fix is used at its own place, and the later ones are used again after it.
"""

import math
from collections import deque

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.motion import Twist
from common.pose import Covariance, Pose
from services.localization.config import Localization
from services.localization.core.estimate import GATE, POSE, Located, Sample, Transform
from services.localization.core.fixes import AGREEING, SourceState, TakenFix, measured_of
from t2 import messages as m
from t2.keys import ODOMETRY
from t2.messages import Phrase
from t2.words import render

KEPT_NS = 2 * NS_PER_S  # of samples and used fixes
USED = 64  # fixes at most that are used again after a late one
PERIOD_S = 1 / ODOMETRY.rate_hz
GAP_S = 0.5  # of odometry, during which its pose may be set without a new placement
SILENT_NS = NS_PER_S // 2  # odometry: the vehicle cannot be placed


class Used(Struct, frozen=True):
    """The transform after a fix, or after a placement."""

    seq: int  # of its odometry sample
    transform: Transform
    fix: TakenFix | None = None

    def corrected(self, fix: TakenFix) -> "Used":
        """Return the transform after one more fix."""
        transform = self.transform.corrected(fix.sample, fix.measured)
        return Used(fix.sample.seq, transform, fix)


class Localizer:
    """The pose of one vehicle in its map."""

    def __init__(self, settings: Localization) -> None:
        self._settings = settings
        self._sources = {name: SourceState(of) for name, of in settings.sources.items()}
        self._odometry: m.Odometry | None = None
        self._samples: deque[Sample] = deque()
        self._used: list[Used] = []  # the base, and the fixes since then, in the order of samples
        self._contradicts = ""  # the source that made the pose lost
        self._restarted = False  # whether odometry did, after a placement
        self._placement = 0

    # --- inputs -----------------------------------------------------------------------------

    def on_odometry(self, odometry: m.Odometry, now_ns: int) -> None:
        """Process a pose of odometry; an older one than the last is ignored."""
        before, covariance = self._odometry, Covariance.of(odometry.pose_covariance)
        pose = Pose(odometry.x, odometry.y, odometry.heading)
        step = odometry.linear * PERIOD_S, odometry.angular * PERIOD_S
        sample = Sample(odometry.seq, pose, covariance, now_ns, step)
        if before is not None and before.boot == odometry.boot:
            if odometry.seq <= before.seq:
                return
            if odometry.epoch != before.epoch:
                self._continue(before, odometry, sample)
            else:
                sample = sample.after(self._samples[-1], Covariance.of(before.pose_covariance))
        elif before is not None:
            self._unplace()
        self._odometry = odometry
        self._samples.append(sample)
        while now_ns - self._samples[0].received_ns > KEPT_NS:
            self._samples.popleft()
        self._settle()

    def on_fix(self, name: str, fix: m.Fix, now_ns: int) -> None:
        """Process a fix of a source of the settings."""
        source = self._sources[name]
        source.received_ns = now_ns
        source.reason = self._judge(name, source, fix)
        source.count()

    def place(self, located: Located, now_ns: int) -> Phrase | None:
        """Place the vehicle; return why not, if it cannot be placed."""
        odometry = self._odometry
        if odometry is None or now_ns - self._samples[-1].received_ns > SILENT_NS:
            return Phrase("place.no_odometry")
        if not Twist(odometry.linear, odometry.angular).is_standing:
            return Phrase("place.moving")
        self._place(located, self._samples[-1])
        return None

    # --- output -----------------------------------------------------------------------------

    def pose(self, now_ns: int) -> m.MapPose | None:
        """Return the pose at the newest odometry; None without any."""
        if self._odometry is None:
            return None
        state, phrase, located = self._state()
        message = m.MapPose(
            state=state,
            odom_boot=self._odometry.boot,
            odom_seq=self._odometry.seq,
            placement=self._placement,
            text=render([phrase]),
            phrases=(phrase,),
            sources=tuple(of.message(name, now_ns) for name, of in self._sources.items()),
        )
        if located is None:
            return message
        pose, origin = located.pose, self._used[-1].transform.origin
        return replace(
            message,
            x=pose.x,
            y=pose.y,
            heading=pose.heading,
            pose_covariance=located.covariance.rows(),
            odom=m.PlaneFrame(x=origin.x, y=origin.y, heading=origin.heading),
        )

    def _state(self) -> tuple[m.MapState, Phrase, Located | None]:
        if not self._used:
            return "unplaced", Phrase("map.restart" if self._restarted else "map.unplaced"), None
        located = self._newest()
        sigma, heading = located.covariance.sigma, located.covariance.heading_sigma
        fields: dict[str, m.Field] = {"sigma": sigma, "degrees": math.degrees(heading)}
        if self._contradicts:
            fields = {"source": self._contradicts, "count": AGREEING}
            return "lost", Phrase("map.contradicted", fields), located
        if self._is_uncertain():
            return "lost", Phrase("map.uncertain", fields), located
        return "placed", Phrase("map.placed", fields), located

    def _newest(self) -> Located:
        return self._used[-1].transform.at(self._samples[-1])

    def _is_uncertain(self) -> bool:
        """Return whether the vehicle is placed, and its pose is not known well enough."""
        covariance, of = self._newest().covariance, self._settings
        return covariance.sigma > of.lost_sigma or covariance.heading_sigma > of.lost_heading_sigma

    # --- fixes ------------------------------------------------------------------------------

    def _judge(self, name: str, source: SourceState, fix: m.Fix) -> Phrase | None:
        """Use a fix, or return why it is refused."""
        sample = self._sample_of(fix)
        if sample is None:
            return Phrase("fix.unknown_odometry")
        measured = measured_of(fix, sample, source.settings)
        if measured is None:
            return Phrase("fix.covariance")
        taken = TakenFix(sample.halfway(), measured)
        if reason := source.fault(taken):
            return reason
        if not self._used:
            return self._place_by(source, taken)
        earlier = [each for each in self._used if each.seq <= sample.seq]
        if not earlier:
            return Phrase("fix.late")
        return self._use(name, taken, earlier)

    def _use(self, name: str, taken: TakenFix, earlier: list[Used]) -> Phrase | None:
        """Use a fix after the earlier ones, or return why not."""
        source, is_uncertain = self._sources[name], self._is_uncertain()
        if is_uncertain and not source.agrees(taken):
            return Phrase("fix.placing", {"count": AGREEING})
        distance = earlier[-1].transform.at(taken.sample).distance(taken.measured)
        if distance > GATE[taken.measured.values]:
            if is_uncertain or source.agrees(taken):
                self._contradicts = self._contradicts or name
            return Phrase("fix.far", {"sigmas": math.sqrt(distance)})
        later = [each.fix for each in self._used[len(earlier) :] if each.fix is not None]
        for each in (taken, *later):
            earlier.append(earlier[-1].corrected(each))
        self._used = earlier[-USED:]
        for other in self._sources.values():
            other.row.clear()  # a source that others do not confirm is outvoted
        return None

    def _sample_of(self, fix: m.Fix) -> Sample | None:
        if self._odometry is None or fix.odom_boot != self._odometry.boot:
            return None
        return next((each for each in self._samples if each.seq == fix.odom_seq), None)

    def _place_by(self, source: SourceState, fix: TakenFix) -> Phrase | None:
        """Place the vehicle by the last of some fixes that agree, or return why not."""
        if not source.settings.places:
            return Phrase("fix.unplaced")
        if fix.measured.values < POSE:
            return Phrase("fix.no_heading")
        if not source.agrees(fix):
            return Phrase("fix.placing", {"count": AGREEING})
        self._place(Located(fix.measured.pose, fix.measured.covariance), fix.sample)
        return None

    # --- transforms -------------------------------------------------------------------------

    def _place(self, located: Located, sample: Sample) -> None:
        self._placement += 1
        self._contradicts, self._restarted = "", False
        self._begin(located, sample)

    def _begin(self, located: Located, sample: Sample) -> None:
        """Begin with a known pose at a sample."""
        self._used = [Used(sample.seq, Transform.of(located, sample))]
        for source in self._sources.values():
            source.begin(anew=False)

    def _unplace(self) -> None:
        self._restarted = self._restarted or bool(self._used)
        self._used, self._contradicts = [], ""
        self._samples.clear()
        for source in self._sources.values():
            source.begin(anew=True)

    def _continue(self, before: m.Odometry, odometry: m.Odometry, sample: Sample) -> None:
        """Keep the pose in the map when the pose in ``odom`` was set.

        The motion between both samples is not known: it counts as that of the last velocity, and as
        its uncertainty.
        """
        gap_s = (odometry.mono_ns - before.mono_ns) / NS_PER_S
        if not self._used or not 0 <= gap_s <= GAP_S:
            self._unplace()
            return
        located = self._used[-1].transform.at(self._samples[-1])
        self._samples.clear()
        distance, turn = before.linear * gap_s, before.angular * gap_s
        pose = located.pose.moved(distance, turn)
        covariance = (
            located.covariance.carried(pose.x - located.pose.x, pose.y - located.pose.y)
            .plus(distance**2, 1.0, 0.0, 0.0)
            .plus(distance**2, 0.0, 1.0, 0.0)
            .plus(turn**2, 0.0, 0.0, 1.0)
        )
        self._begin(Located(pose, covariance), sample)

    def _settle(self) -> None:
        """Forget all but the newest of the transforms that no fix can precede any more."""
        old = sum(each.seq < self._samples[0].seq for each in self._used)
        self._used = self._used[max(old - 1, 0) :]
