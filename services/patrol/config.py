"""Settings of patrol."""

from typing import Annotated
from zoneinfo import ZoneInfo

import msgspec
from cronsim import CronSim, CronSimError
from msgspec import Meta

from common import settings
from common.settings import SourceName, allowed
from services.patrol.schedule import EPOCH
from t2.messages import RouteName

Schedules = Annotated[dict[SourceName, "ScheduledRound"], Meta(max_length=50)]


class ScheduledRound(settings.Section, frozen=True, kw_only=True):
    """A route, and when its rounds start."""

    route: RouteName
    cron: str  # minute, hour, day, month, day of the week: "0 22 * * *" is each day at 22:00

    def __post_init__(self) -> None:
        try:
            CronSim(f"0 {self.cron}", EPOCH)  # with seconds, of which there are none
        except CronSimError as error:
            raise ValueError(
                f'cron is {self.cron!r} ({error}), allowed is a cron expression as "30 22 * * 1-5"'
            ) from None


class Patrol(settings.Section, frozen=True, kw_only=True):
    """Where routes and rounds are kept, and how a round behaves."""

    folder: Annotated[str, Meta(min_length=1)] = "patrol"  # created if missing
    # before the vehicle begins to move
    announce: Annotated[float, allowed("s", ge=0.0, le=60.0)] = 3.0
    # without progress, until the route's ``blocked`` decides
    patience: Annotated[float, allowed("s", ge=10.0, le=3600.0)] = 60.0
    lamp_channel: Annotated[int, Meta(ge=0, le=255)] = 0  # that announces a round; 0: none
    lamp_mode: Annotated[int, Meta(ge=1, le=255)] = 1  # in the board's own numbers
    timezone: str = ""  # of the schedule, as Europe/Berlin; empty: the computer's
    # a scheduled round that would start later than this is skipped
    grace: Annotated[float, allowed("s", ge=1.0, le=3600.0)] = 60.0
    # rounds by name, as night = { route = "yard", cron = "0 22 * * *" }
    schedule: Schedules = msgspec.field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.timezone:
            try:
                ZoneInfo(self.timezone)
            except (OSError, ValueError, KeyError):
                raise ValueError(
                    f"timezone is {self.timezone!r}, allowed is a name as Europe/Berlin that this "
                    "computer knows (`timedatectl list-timezones`)"
                ) from None


class PatrolConfig(settings.Shared, frozen=True, kw_only=True):
    """The sections that patrol reads."""

    patrol: Patrol = Patrol()
