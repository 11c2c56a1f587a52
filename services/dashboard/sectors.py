"""Tones of the eight sonar sectors, as the page draws them.

A sector's tone shows the effect of its reading on safety, by safety's own formula and settings: the
speed allowed toward a reading d is the v for which v * r + v^2 / (2 a) = d - margin, and
r is react + 2 stall.

====== ====================================================================================
tone   when
====== ====================================================================================
dark   no fresh message
fault  the sonar is faulty, or safety does not trust it
stop   within the margin, too near to measure, or safety names it as blocking
slow   nearer than full speed allows, or safety names it as slowing the vehicle
clear  otherwise
====== ====================================================================================
"""

import math
from collections.abc import Sequence
from typing import Annotated, Literal

from msgspec import Meta, Struct

from common.messages import SONAR_NAMES, Cause, RangeStatus, Ultrasonic

Tone = Literal["dark", "clear", "slow", "stop", "fault"]
Number = Annotated[float, Meta(gt=0)]

WORST: tuple[Tone, ...] = ("dark", "clear", "slow", "stop", "fault")
OF_STATUS: dict[RangeStatus, Tone] = {"no_echo": "clear", "too_near": "stop", "fault": "fault"}
OF_CAUSE: dict[str, Tone] = {"obstacle": "slow", "blocked": "stop", "sonar": "fault"}


class Protection(Struct, frozen=True, kw_only=True):
    """Safety's settings for sonar; the defaults until the running service has answered."""

    margin: float = 0.20  # m
    react: float = 0.25  # s
    stall: float = 0.0  # s
    deceleration: Number = 0.6  # m/s^2
    max_linear: float = 1.0  # m/s

    @property
    def full_speed_room(self) -> float:
        """The reading at which full speed is allowed, in metres."""
        speed = self.max_linear
        return (
            self.margin + speed * (self.react + 2 * self.stall) + speed**2 / (2 * self.deceleration)
        )


def tones(
    ultrasonic: Ultrasonic | None, causes: Sequence[Cause], protection: Protection
) -> tuple[Tone, ...]:
    """Return the tone of each sector, in the manual's order of sonars."""
    if ultrasonic is None:
        return tuple("dark" for _ in SONAR_NAMES)
    own: list[Tone] = [
        OF_STATUS.get(status) or _by_range(reading, protection)
        for status, reading in zip(ultrasonic.status, ultrasonic.ranges, strict=True)
    ]
    for cause in causes:
        for index in sonars_named(cause.text) if cause.name in OF_CAUSE else ():
            own[index] = max(own[index], OF_CAUSE[cause.name], key=WORST.index)
    return tuple(own)


def sonars_named(text: str) -> list[int]:
    """Return the sonars named in a text of safety; "front left" does not name "front"."""
    found = []
    for name in sorted(SONAR_NAMES, key=len, reverse=True):
        words = name.replace("_", " ")
        if words in text:
            text = text.replace(words, "")
            found.append(SONAR_NAMES.index(name))
    return found


def _by_range(reading: float | None, protection: Protection) -> Tone:
    if reading is None or not math.isfinite(reading):
        return "dark"
    if reading <= protection.margin:
        return "stop"
    return "slow" if reading < protection.full_speed_room else "clear"
