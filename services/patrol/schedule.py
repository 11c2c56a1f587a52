"""The schedule: when the next round is due, by the wall clock in its time zone.

A clock that jumps forward, or a computer that slept, makes rounds late: later than the grace time,
they are skipped. After a jump backward a round that has begun is not due again within ``AGAIN_S``.
"""

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta, tzinfo
from typing import NamedTuple, Protocol

from cronsim import CronSim

EPOCH = datetime(2026, 1, 1, tzinfo=UTC)
AGAIN_S = 3600.0  # of the monotonic clock
BACKWARD = timedelta(seconds=5)  # of the wall clock; less is no jump


class Row(Protocol):
    """A row of the settings."""

    @property
    def route(self) -> str: ...  # noqa: D102
    @property
    def cron(self) -> str: ...  # noqa: D102


class Due(NamedTuple):
    """A round that is due."""

    schedule: str
    route: str
    late_s: float


class Schedule:
    """Rounds by their cron expressions."""

    def __init__(self, rows: Mapping[str, Row], zone: tzinfo | None, now: datetime) -> None:
        self._rows = rows
        self._zone = zone
        self._seen = now
        self._next = {name: self._after(name, now) for name in rows}
        self._begun: dict[str, tuple[datetime, float]] = {}  # the due time, and when, monotonic

    @property
    def next(self) -> tuple[str, str, datetime] | None:
        """Name, route and time of the next round; None without any."""
        times = [(at, name) for name, at in self._next.items() if at is not None]
        if not times:
            return None
        at, name = min(times)
        return name, self._rows[name].route, at

    def due(self, now: datetime, now_s: float) -> list[Due]:
        """Return the rounds that are due; ``now_s`` is the monotonic time."""
        if now < self._seen - BACKWARD:
            self._next = {name: self._after(name, now) for name in self._rows}
        self._seen = now
        found = []
        for name, at in self._next.items():
            if at is None or now < at:
                continue
            begun = self._begun.get(name)
            if begun is None or at > begun[0] or now_s - begun[1] > AGAIN_S:
                found.append(Due(name, self._rows[name].route, (now - at).total_seconds()))
                self._begun[name] = at, now_s
        self._next |= {each.schedule: self._after(each.schedule, now) for each in found}
        passed = [name for name, at in self._next.items() if at is not None and at <= now]
        self._next |= {name: self._after(name, now) for name in passed}
        return found

    def _after(self, name: str, now: datetime) -> datetime | None:
        """Return the first time of a row after now, in its own zone."""
        local = now.astimezone(self._zone)
        return next(iter(CronSim(self._rows[name].cron, local)), None)
