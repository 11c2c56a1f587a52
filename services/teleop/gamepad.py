"""Gamepad input through SDL, with hot-plugging.

pygame is imported only if a gamepad is enabled, because the import takes a second. SDL requires
that all calls come from one thread: the loop's. SDL misses the event of some devices that come or
go, so the devices are listed regularly, too. ``core.pads`` decides which one drives.
"""

import contextlib
import os
from types import ModuleType
from typing import Any

from services.teleop.config import Teleop
from services.teleop.core.controls import Stick
from services.teleop.core.pads import Pads, Reading, is_usable
from t2.messages import Phrase

ENVIRON = {
    "PYGAME_HIDE_SUPPORT_PROMPT": "1",  # its banner would overwrite the screen
    "SDL_VIDEODRIVER": "dummy",  # events need a display, and ssh has none
    "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1",  # without a window there is no foreground
    "SDL_NO_SIGNAL_HANDLERS": "1",  # teleop handles ctrl-c
}
LIST_READS = 100  # from one list of the devices to the next: 5 s


class Gamepad:
    """A gamepad; this one is disabled or unavailable."""

    def __init__(self, status: Phrase) -> None:
        self.status = status  # its name, or why it is missing
        self.ignored: dict[int, float] = {}  # axes that do not count, with their position

    def read(self) -> Stick | None:
        """Return the current state; None without a gamepad."""
        return None


class SdlGamepad(Gamepad):
    """All gamepads that SDL finds; the one whose deadman is held drives."""

    def __init__(self, pygame: ModuleType, settings: Teleop) -> None:
        super().__init__(Phrase("gamepad.none"))
        self._pygame: Any = pygame
        self._settings = settings
        self._pads = Pads(settings)
        self._devices: dict[int, Any] = {}  # usable ones, by SDL's number
        self._reads = 0
        pygame.display.init()
        pygame.joystick.init()

    def read(self) -> Stick | None:
        """Return the current state; None without a gamepad."""
        events = {event.type for event in self._pygame.event.get()}
        is_due = self._reads % LIST_READS == 0
        if is_due and self._reads and not self._devices:  # SDL may have missed one
            self._pygame.joystick.quit()
            self._pygame.joystick.init()
        if is_due or events & {self._pygame.JOYDEVICEADDED, self._pygame.JOYDEVICEREMOVED}:
            self._list()
        self._reads += 1
        readings = {}
        for number, device in self._devices.items():
            with contextlib.suppress(self._pygame.error):  # unplugged in the meantime
                readings[number] = _reading(device)
        stick = self._pads.update(readings)
        self.ignored = self._pads.ignored
        if self._pads.driving is not None:
            self.status = _named(self._devices[self._pads.driving])
        return stick

    def _list(self) -> None:
        """Open all devices, and name the one that can drive, or why none can."""
        before, settings = set(self._devices), self._settings
        self._devices, missing = {}, Phrase("gamepad.none")
        for index in range(self._pygame.joystick.get_count()):
            with contextlib.suppress(self._pygame.error):  # unplugged in the meantime
                device = self._pygame.joystick.Joystick(index)
                if is_usable(settings, device.get_numaxes(), device.get_numbuttons()):
                    self._devices[device.get_instance_id()] = device
                else:
                    missing = Phrase("gamepad.unusable", {"device": str(device.get_name())})
        if set(self._devices) == before and before:
            return
        found = [_named(device) for device in self._devices.values()] or [missing]
        several = Phrase("gamepad.several", {"count": len(found)})
        self.status = found[0] if len(found) == 1 else several


def _named(device: Any) -> Phrase:
    return Phrase("gamepad.device", {"device": str(device.get_name())})


def _reading(device: Any) -> Reading:
    return Reading(
        axes=tuple(device.get_axis(index) for index in range(device.get_numaxes())),
        buttons=(
            *(device.get_button(index) for index in range(device.get_numbuttons())),
            *(device.get_hat(index) for index in range(device.get_numhats())),
        ),
    )


def find(settings: Teleop) -> Gamepad:
    """Return the gamepad of the settings, or one without input that names the reason."""
    if not settings.gamepad:
        return Gamepad(Phrase("gamepad.off"))
    for name, value in ENVIRON.items():
        os.environ.setdefault(name, value)
    try:
        import pygame
    except ImportError:
        return Gamepad(Phrase("gamepad.no_library"))
    try:
        return SdlGamepad(pygame, settings)
    except pygame.error as error:
        return Gamepad(Phrase("gamepad.failed", {"reason": str(error)}))
