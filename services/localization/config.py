"""Settings of localization."""

from typing import Annotated

import msgspec
from msgspec import Meta

from common import settings
from common.settings import SourceName, allowed

Sources = Annotated[dict[SourceName, "FixSource"], Meta(max_length=8)]


class FixSource(settings.Section, frozen=True, kw_only=True):
    """A source of fixes; these standard deviations are added to those of its fixes."""

    sigma: Annotated[float, allowed("m", gt=0.0, le=10.0)] = 0.02  # of x and y
    heading_sigma: Annotated[float, allowed("rad", gt=0.0, le=3.0)] = 0.02
    # whether it may place a vehicle that is not placed, without an operator
    places: bool = False


class Localization(settings.Section, frozen=True, kw_only=True):
    """Where the pose in the map comes from, and when it is lost."""

    # sources on @cmd/fix/NAME, as tags = { sigma = 0.05, places = true }
    sources: Sources = msgspec.field(default_factory=dict)
    # a pose that is less certain than this is lost: standard deviations
    lost_sigma: Annotated[float, allowed("m", gt=0.0, le=100.0)] = 1.0
    lost_heading_sigma: Annotated[float, allowed("rad", gt=0.0, le=3.0)] = 0.5


class LocalizationConfig(settings.Shared, frozen=True, kw_only=True):
    """The sections that localization reads."""

    localization: Localization = Localization()
