"""Gamepad input through SDL, with hot-plugging.

pygame is imported only if a gamepad is enabled, because the import takes a second. SDL requires
that all calls come from one thread: the loop's.
"""

import contextlib
import os
from types import ModuleType
from typing import Any

from services.teleop.config import Teleop
from services.teleop.core.controls import Deflection, Stick

ENVIRON = {
    "PYGAME_HIDE_SUPPORT_PROMPT": "1",  # its banner would overwrite the screen
    "SDL_VIDEODRIVER": "dummy",  # events need a display, and ssh has none
    "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1",  # without a window there is no foreground
    "SDL_NO_SIGNAL_HANDLERS": "1",  # teleop handles ctrl-c
}


class Gamepad:
    """A gamepad; this one is disabled or unavailable."""

    def __init__(self, status: str) -> None:
        self.status = status  # its name, or why it is missing

    def read(self) -> Stick | None:
        """Return the current state; None without a gamepad."""
        return None


class SdlGamepad(Gamepad):
    """The first gamepad that SDL finds; after its loss, the next one."""

    def __init__(self, pygame: ModuleType, settings: Teleop) -> None:
        super().__init__("none")
        self._pygame: Any = pygame
        self._settings = settings
        self._joystick: Any = None
        self._events = 0  # axis and button events
        self._input_events = {
            pygame.JOYAXISMOTION, pygame.JOYBALLMOTION, pygame.JOYHATMOTION,
            pygame.JOYBUTTONDOWN, pygame.JOYBUTTONUP,
        }  # fmt: skip
        pygame.display.init()
        pygame.joystick.init()

    def read(self) -> Stick | None:
        """Return the current state; None without a gamepad."""
        for event in self._pygame.event.get():
            self._handle(event)
        if self._joystick is None and self._pygame.joystick.get_count():
            with contextlib.suppress(self._pygame.error):  # unplugged in the meantime
                self._joystick = self._pygame.joystick.Joystick(0)
        self.status = str(self._joystick.get_name()) if self._joystick else "none"
        return self._stick() if self._joystick else None

    def _handle(self, event: Any) -> None:
        if not self._joystick:
            return
        if getattr(event, "instance_id", None) != self._joystick.get_instance_id():
            return
        if event.type == self._pygame.JOYDEVICEREMOVED:
            self._joystick = None
        elif event.type in self._input_events:
            self._events += 1

    def _stick(self) -> Stick:
        joystick, settings = self._joystick, self._settings
        linear, angular = (  # a missing axis or button is at rest
            joystick.get_axis(index) if index < joystick.get_numaxes() else 0.0
            for index in (settings.linear_axis, settings.angular_axis)
        )
        button = settings.deadman_button
        deadman = button < joystick.get_numbuttons() and bool(joystick.get_button(button))
        return Stick(Deflection(-linear, -angular), deadman, self._events)


def find(settings: Teleop) -> Gamepad:
    """Return the gamepad of the settings, or one without input that names the reason."""
    if not settings.gamepad:
        return Gamepad("off")
    for name, value in ENVIRON.items():
        os.environ.setdefault(name, value)
    try:
        import pygame
    except ImportError:
        return Gamepad("none: pygame-ce is not installed")
    try:
        return SdlGamepad(pygame, settings)
    except pygame.error as error:
        return Gamepad(f"none: {error}")
