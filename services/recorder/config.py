"""The recorder's settings."""

from typing import Annotated

from msgspec import Meta

from common import settings

MB = 1_000_000


class Recorder(settings.Section, frozen=True, kw_only=True):
    """What is recorded, where, and how much; the black box is always on."""

    folder: Annotated[str, Meta(min_length=1)] = "recordings"  # created if missing
    everything: bool = False  # record continuously, not only after a latch
    roll_size: Annotated[float, Meta(ge=1.0, le=10_000.0)] = 200.0  # MB, then a new file
    roll_time: Annotated[float, Meta(ge=10.0, le=86_400.0)] = 600.0  # s, then a new file
    free: Annotated[float, Meta(ge=1.0, le=1_000_000.0)] = 1000.0  # MB to keep free on the disk
    make_room: bool = True  # remove the oldest recordings; see retention.py
    black_box: Annotated[float, Meta(ge=10.0, le=600.0)] = 120.0  # s buffered in memory
    black_box_size: Annotated[float, Meta(ge=1.0, le=1000.0)] = 64.0  # MB of memory, limit
    tail: Annotated[float, Meta(ge=1.0, le=60.0)] = 10.0  # s recorded after a latch


class RecorderConfig(settings.Shared, frozen=True, kw_only=True):
    """All sections that the recorder uses."""

    vehicle: settings.Vehicle = settings.Vehicle()
    recorder: Recorder = Recorder()
