"""Paths in a recording: by odometry in ``odom``, and in the map with its ellipses and fixes. Pure.

A fix has no answer of its own. Whether it was used follows from the counters ``used`` and
``refused`` of its source in the next poses in the map: they are matched in the order of arrival.
"""

import math
from collections import defaultdict
from dataclasses import dataclass, field
from itertools import pairwise

from common.pose import Covariance
from t2.messages import Fix, FixState, MapPose, MapState, Message

ELLIPSE_S = 5.0  # between two ellipses
STATE_GAP_S = 0.5  # a state ends after this time without a message
WAITING_S = 1.0  # a fix that is not counted until then stays unknown: localization did not get it


@dataclass(slots=True)
class PathSegment:
    """The path of one epoch of odometry, or since one placement in the map; m."""

    epoch: tuple[int, int]
    times: list[float] = field(default_factory=list)
    xs: list[float] = field(default_factory=list)
    ys: list[float] = field(default_factory=list)

    def add(self, at_s: float, x: float, y: float) -> None:
        """Add a position."""
        self.times.append(at_s)
        self.xs.append(x)
        self.ys.append(y)

    @property
    def length(self) -> float:
        """Return its length in metres."""
        points = list(zip(self.xs, self.ys, strict=True))
        return sum(math.dist(before, after) for before, after in pairwise(points))


def segment_of(path: list[PathSegment], epoch: tuple[int, int]) -> PathSegment:
    """Return the last segment, or begin one for another epoch."""
    if not path or path[-1].epoch != epoch:
        path.append(PathSegment(epoch))
    return path[-1]


@dataclass(slots=True)
class StateSpan:
    """A period of one state of localization."""

    begins_s: float
    ends_s: float
    state: MapState


@dataclass(frozen=True, slots=True)
class MapFix:
    """A fix at its position in the map, m, and whether it was used."""

    x: float
    y: float
    used: bool


@dataclass(frozen=True, slots=True)
class MapEllipse:
    """Uncertainty of a position: half axes of one standard deviation in m, direction in rad."""

    x: float
    y: float
    axes: tuple[float, float, float]


@dataclass(slots=True)
class MapTrack:
    """The pose in the map over a recording, updated message by message."""

    path: list[PathSegment] = field(default_factory=list)
    ellipses: list[MapEllipse] = field(default_factory=list)
    fixes: list[MapFix] = field(default_factory=list)
    states: list[StateSpan] = field(default_factory=list)
    _ellipse_s: float = -math.inf  # of the newest one
    _counted: dict[tuple[int, str], FixState] = field(default_factory=dict)  # by boot and source
    _waiting: dict[str, list[tuple[float, Fix]]] = field(default_factory=lambda: defaultdict(list))

    def add(self, message: Message, key: str, at_s: float) -> None:
        """Add a pose in the map, or a fix; other messages are ignored."""
        match message:
            case MapPose():
                self._add_pose(message, at_s)
            case Fix():
                self._waiting[key.rpartition("/")[2]].append((at_s, message))

    def lasted_s(self, state: MapState) -> float:
        """Return for how long this was the state."""
        return sum(each.ends_s - each.begins_s for each in self.states if each.state == state)

    def _add_pose(self, pose: MapPose, at_s: float) -> None:
        self._add_state(pose.state, at_s)
        for source in pose.sources:
            self._count(pose.boot, source, at_s)
        if pose.x is None or pose.y is None:
            return
        segment_of(self.path, (pose.boot, pose.placement)).add(at_s, pose.x, pose.y)
        if pose.pose_covariance and at_s - self._ellipse_s >= ELLIPSE_S:
            self._ellipse_s = at_s
            axes = Covariance.of(pose.pose_covariance).ellipse
            self.ellipses.append(MapEllipse(pose.x, pose.y, axes))

    def _add_state(self, state: MapState, at_s: float) -> None:
        last = self.states[-1] if self.states else None
        if last is not None and at_s - last.ends_s <= STATE_GAP_S:
            last.ends_s = at_s  # a state that ends lasts until the next one
            if last.state == state:
                return
        self.states.append(StateSpan(at_s, at_s, state))

    def _count(self, boot: int, now: FixState, at_s: float) -> None:
        """Match the fixes of a source with the change of its counters."""
        before = self._counted.get((boot, now.source), now)
        self._counted[boot, now.source] = now
        used, refused = now.used - before.used, now.refused - before.refused
        since = min(now.in_a_row, refused)  # after the last one that was used
        outcomes = [False] * (refused - since) + [True] * used + [False] * since
        waiting = [each for each in self._waiting[now.source] if at_s - each[0] <= WAITING_S]
        outcomes = outcomes[max(0, len(outcomes) - len(waiting)) :]
        for (_, fix), is_used in zip(waiting, outcomes, strict=False):
            self.fixes.append(MapFix(fix.x, fix.y, is_used))
        self._waiting[now.source] = waiting[len(outcomes) :]
