"""What is written of a round: the line of the ledger, and the driven poses."""

import math

from msgspec.structs import replace

from services.patrol.core.track import Fit
from t2 import messages as m
from t2.messages import MAX_TRACK, Phrases
from t2.words import render

SPACING = 0.2  # m between two poses of the track, at first
JUMP = 0.5  # m between two poses: a correction, and not driven
MOST = 200  # visits and halts each: the rest of a round that never ends is not listed
FILES, NAME = 20, 200  # black boxes, and characters of the name of one


class Diary:
    """The record of one round."""

    def __init__(self, record: m.Round) -> None:
        self.record = record
        self.track: list[m.TrackPoint] = []
        self._spacing = SPACING
        self._last: tuple[float, float] | None = None  # the last pose
        self._noted = math.inf  # m driven since the last pose of the track
        self._halt: m.Halt | None = None

    def on_pose(self, x: float, y: float, fit: Fit) -> None:
        """Note a pose of the moving round."""
        step = math.dist(self._last, (x, y)) if self._last else 0.0
        self._last = x, y
        if step <= JUMP:
            self._noted += step
        record, deviation = self.record, fit.nearest.deviation
        least = fit.margin if record.margin is None else min(record.margin, fit.margin)
        self.record = replace(
            record,
            distance=record.distance + (step if step <= JUMP else 0.0),
            deviation=max(record.deviation, deviation),
            sigma=max(record.sigma, fit.sigma),
            margin=least,
        )
        if self._noted >= self._spacing:
            self._noted = 0.0
            self._keep(m.TrackPoint(x=x, y=y, deviation=deviation, sigma=fit.sigma))

    def visit(self, station: str, wall_ns: int) -> None:
        """Note the arrival at a station."""
        if len(self.record.visits) < MOST:
            visits = (*self.record.visits, m.Visit(station=station, t_ns=wall_ns))
            self.record = replace(self.record, visits=visits)

    def file(self, name: str) -> None:
        """Note a black box of this time."""
        if len(self.record.recordings) < FILES:
            self.record = replace(self.record, recordings=(*self.record.recordings, name[:NAME]))

    def halt(
        self, state: m.RoundState, phrases: Phrases, at: tuple[float, float], wall_ns: int
    ) -> None:
        """Note that the round does not get on from now, at (x, y), m."""
        self.go_on(wall_ns)
        x, y = at
        self._halt = m.Halt(
            state=state, t_ns=wall_ns, seconds=0.0, x=x, y=y, text=render(phrases), phrases=phrases
        )

    def go_on(self, wall_ns: int) -> None:
        """Note that it gets on, or ends."""
        halt, self._halt = self._halt, None
        if halt is not None and len(self.record.halts) < MOST:
            # The wall clock may have been set backward.
            seconds = max(0.0, (wall_ns - halt.t_ns) / 1e9)
            halts = (*self.record.halts, replace(halt, seconds=seconds))
            self.record = replace(self.record, halts=halts)

    def end(self, result: m.RoundResult, phrases: Phrases, wall_ns: int) -> None:
        """Note the end."""
        self.go_on(wall_ns)
        self.record = replace(
            self.record, end_ns=wall_ns, result=result, text=render(phrases), phrases=phrases
        )

    def _keep(self, point: m.TrackPoint) -> None:
        if len(self.track) == MAX_TRACK:
            self.track = self.track[::2]
            self._spacing *= 2
        self.track.append(point)
