"""Gamepads: which device drives, which of its axes count, and whether its reading changes.

**Device.** The device whose deadman goes down drives until it comes up. A deadman counts after it
was seen up. One that goes down while another device drives must come up first.

**Axes.** An axis may belong to a trigger, which rests at one end, or to a worn stick. Until the
first report of a device SDL reads 0 or an end, whatever the axis does. When the deadman goes down,
an axis therefore counts, or is ignored until the next press:

================= =============== =========================================
the reading of    the reading of  axis
the press         before
================= =============== =========================================
centred           any             counts
off centre        centred         counts: stick and deadman moved together
at an end         any             ignored
off centre        off centre      ignored
no finite number  any             ignored, also in a later reading
================= =============== =========================================

**Change.** ``Deadman`` lets go of a deflected stick whose reading does not change. A live stick
changes by more than the noise of a converter.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from operator import sub

from services.teleop.config import Teleop
from services.teleop.core.controls import Deflection, Stick

NOISE = 0.001  # of an axis; one step of a 10-bit converter is 0.002
AT_END = 0.95  # of an axis


@dataclass(frozen=True, slots=True)
class Reading:
    """Raw state of a device; its hats are among the buttons."""

    axes: tuple[float, ...]
    buttons: tuple[object, ...]

    def axis(self, index: int) -> float:
        """Return the position of an axis, -1..1; a missing one is at rest."""
        return self.axes[index] if index < len(self.axes) else 0.0

    def differs(self, other: "Reading") -> bool:
        """Return whether it differs by more than noise."""
        steps = map(sub, self.axes, other.axes)
        return self.buttons != other.buttons or any(abs(step) > NOISE for step in steps)


class Pad:
    """One device."""

    went_down: bool  # the deadman, in the newest reading
    has_changed: bool  # the newest reading

    def __init__(self, settings: Teleop, reading: Reading) -> None:
        self.is_down = True  # the deadman; unknown, so it must come up
        self.ignored: dict[int, float] = {}  # axes, by index, with their position
        self._settings = settings
        self._axes = settings.linear_axis, settings.angular_axis
        self._newest = self._changed = reading

    def update(self, reading: Reading) -> None:
        """Process the newest reading."""
        before, self._newest = self._newest, reading
        self.has_changed = reading.differs(self._changed)
        if self.has_changed:
            self._changed = reading
        is_down = bool(reading.buttons[self._settings.deadman_button])
        self.went_down, self.is_down = is_down and not self.is_down, is_down
        if self.went_down:
            self.ignored = {
                index: reading.axis(index)
                for index in self._axes
                if not self._counts(before.axis(index), reading.axis(index))
            }
        for index in self._axes:
            if not math.isfinite(reading.axis(index)):
                self.ignored[index] = reading.axis(index)

    def push(self) -> Deflection:
        """Return the deflection of the axes that count."""
        linear, angular = (
            0.0 if index in self.ignored else -self._newest.axis(index) for index in self._axes
        )
        return Deflection(linear, angular)

    def _counts(self, before: float, now: float) -> bool:
        centred = self._settings.deadzone
        return abs(now) <= centred or (abs(before) <= centred and abs(now) < AT_END)


class Pads:
    """All devices that may drive."""

    def __init__(self, settings: Teleop) -> None:
        self.driving: int | None = None  # the device that drives
        self._settings = settings
        self._pads: dict[int, Pad] = {}
        self._changes = 0  # of the readings of the device that drives

    @property
    def ignored(self) -> dict[int, float]:
        """Return the ignored axes of the device that drives, with their position."""
        return {} if self.driving is None else self._pads[self.driving].ignored

    def update(self, readings: Mapping[int, Reading]) -> Stick | None:
        """Return the state of the device that drives; None without any device."""
        pads = self._pads
        self._pads = {
            number: pads.get(number) or Pad(self._settings, reading)
            for number, reading in readings.items()
        }
        for number, reading in readings.items():
            self._pads[number].update(reading)
        if self.driving not in self._pads or not self._pads[self.driving].is_down:
            pressed = (number for number, pad in self._pads.items() if pad.went_down)
            self.driving = next(pressed, None)
        if self.driving is None:
            return Stick(Deflection(), deadman=False, events=self._changes) if readings else None
        pad = self._pads[self.driving]
        self._changes += pad.has_changed
        return Stick(pad.push(), deadman=True, events=self._changes)


def is_usable(settings: Teleop, axes: int, buttons: int) -> bool:
    """Return whether a device with so many axes and buttons can drive."""
    return (
        settings.deadman_button < buttons
        and min(settings.linear_axis, settings.angular_axis) < axes
    )
