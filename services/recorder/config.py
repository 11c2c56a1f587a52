"""The recorder's settings."""

from typing import Annotated

from msgspec import Meta

from common import settings
from common.settings import allowed


class Recorder(settings.Section, frozen=True, kw_only=True):
    """What is recorded, and where; the black box is always on."""

    folder: Annotated[str, Meta(min_length=1)] = "recordings"  # created if missing
    everything: bool = False  # record continuously, not only after a latch
    free: Annotated[float, allowed("MB", ge=1.0, le=1_000_000.0)] = 1000.0  # kept free on the disk
    make_room: bool = True  # remove the oldest recordings; see storage.py


class RecorderConfig(settings.Shared, frozen=True, kw_only=True):
    """All sections that the recorder uses."""

    vehicle: settings.Vehicle = settings.Vehicle()
    recorder: Recorder = Recorder()
