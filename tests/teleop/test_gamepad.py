"""The gamepad: virtual ones of SDL, if pygame is installed, and a missing one."""

import ctypes
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import pytest

from common.settings import Vehicle
from services.teleop.config import Teleop
from services.teleop.core.controls import Controls, Deflection, Stick
from services.teleop.gamepad import LIST_READS, SdlGamepad, find
from tests.teleop.support import english

MAPS = Path("/proc/self/maps")
DEADMAN = 4
HALF = -16_384


def fake_pygame(**fails: str) -> MagicMock:
    """Return a pygame with one gamepad, of which a call of ``joystick`` fails."""
    pygame = MagicMock(error=RuntimeError)
    pygame.event.get.return_value = []
    pygame.joystick.get_count.return_value = 1
    for name, error in fails.items():
        getattr(pygame.joystick, name).side_effect = RuntimeError(error)
    return pygame


@pytest.mark.parametrize(
    ("pygame", "enabled", "status"),
    [
        (None, False, "off"),  # importing it would fail
        (None, True, "none: pygame-ce is not installed"),
        (fake_pygame(init="no joystick subsystem"), True, "none: no joystick subsystem"),
        (fake_pygame(Joystick="Invalid joystick device number"), True, "none"),  # gone meanwhile
    ],
)
def test_a_missing_gamepad_names_the_reason(
    monkeypatch: pytest.MonkeyPatch, pygame: Any, enabled: bool, status: str
) -> None:
    monkeypatch.setitem(sys.modules, "pygame", pygame)
    pad = find(Teleop(gamepad=enabled))
    assert (english((pad.status,)), pad.read()) == (status, None)


# --- SDL ------------------------------------------------------------------------------------


class VirtualGamepad:
    """A virtual gamepad of SDL."""

    def __init__(self, axes: int = 6, buttons: int = 11) -> None:
        library = next(
            line.split()[-1] for line in MAPS.read_text().splitlines() if "libSDL2-" in line
        )
        self._sdl = ctypes.CDLL(library)
        self._sdl.SDL_JoystickOpen.restype = ctypes.c_void_p
        self.index = self._sdl.SDL_JoystickAttachVirtual(1, axes, buttons, 0)
        self._handle = ctypes.c_void_p(self._sdl.SDL_JoystickOpen(self.index))

    def push(self, axis: int, value: int) -> None:
        self._sdl.SDL_JoystickSetVirtualAxis(self._handle, axis, ctypes.c_int16(value))

    def press(self, button: int, *, down: bool = True) -> None:
        self._sdl.SDL_JoystickSetVirtualButton(self._handle, button, down)

    def unplug(self) -> None:
        self._sdl.SDL_JoystickClose(self._handle)
        self._sdl.SDL_JoystickDetachVirtual(self.index)


@pytest.fixture
def pad(capfd: pytest.CaptureFixture[str]) -> SdlGamepad:
    if find_spec("pygame") is None:
        pytest.skip("pygame is not installed")
    pad = find(Teleop())
    assert capfd.readouterr() == ("", "")  # without a display, and without its banner
    if not (isinstance(pad, SdlGamepad) and MAPS.exists() and "libSDL2-" in MAPS.read_text()):
        pytest.skip("SDL 2 is not available")
    return pad


@pytest.fixture
def virtual(pad: SdlGamepad) -> Iterator[VirtualGamepad]:
    gamepad = VirtualGamepad()
    yield gamepad
    gamepad.unplug()
    assert pad.read() is None


def test_sticks_and_buttons_are_read_and_each_change_counts(
    pad: SdlGamepad, virtual: VirtualGamepad
) -> None:
    assert pad.status.name == "gamepad.none"
    assert pad.read() == Stick(Deflection(0.0, 0.0), deadman=False, events=0)
    assert pad.status.name == "gamepad.device"
    virtual.press(DEADMAN)
    virtual.push(1, HALF)
    virtual.push(3, HALF // 2)
    assert pad.read() == Stick(Deflection(0.5, 0.25), deadman=True, events=1)
    virtual.push(1, HALF)  # still, or frozen
    assert pad.read() == Stick(Deflection(0.5, 0.25), deadman=True, events=1)


def test_a_lost_gamepad_reads_as_none_and_the_next_one_drives(pad: SdlGamepad) -> None:
    first, second = VirtualGamepad(), VirtualGamepad()
    assert pad.read() == Stick(Deflection(0.0, 0.0), deadman=False, events=0)
    assert english((pad.status,)) == "2 found: hold a deadman"
    first.unplug()
    second.index -= 1
    assert pad.read() == Stick(Deflection(0.0, 0.0), deadman=False, events=0)
    second.press(DEADMAN)
    second.push(1, HALF)
    stick = pad.read()
    assert stick is not None
    assert stick.push == Deflection(0.5, 0.0)
    second.unplug()
    assert pad.read() is None
    assert pad.status.name == "gamepad.none"


def test_the_deadman_chooses_the_device_and_media_keys_are_none(pad: SdlGamepad) -> None:
    keys, idle, held = VirtualGamepad(0, 40), VirtualGamepad(2, 8), VirtualGamepad()
    keys.press(DEADMAN)
    pad.read()
    held.press(DEADMAN)
    held.push(1, HALF)
    assert pad.read() == Stick(Deflection(0.5, 0.0), deadman=True, events=1)
    idle.press(DEADMAN)  # too late, and without the axis of the angular speed
    assert pad.read() == Stick(Deflection(0.5, 0.0), deadman=True, events=1)
    held.press(DEADMAN, down=False)
    assert pad.read() == Stick(Deflection(0.0, 0.0), deadman=False, events=1)
    for one in (held, idle):
        one.unplug()
    assert pad.read() is None
    assert english((pad.status,)).endswith("has no such axes or deadman")
    keys.unplug()


def test_a_device_without_an_event_is_found(
    pad: SdlGamepad, virtual: VirtualGamepad, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pad._pygame.event, "get", list)
    assert pad.read() is not None
    other = VirtualGamepad()
    other.press(DEADMAN)
    for _ in range(2 * LIST_READS):
        pad.read()
    other.press(DEADMAN, down=False)
    monkeypatch.undo()
    pad.read()
    other.press(DEADMAN)
    stick = pad.read()
    assert stick is not None
    assert stick.deadman
    other.unplug()


def test_sdl_is_started_again_while_it_finds_no_device(monkeypatch: pytest.MonkeyPatch) -> None:
    pygame = fake_pygame()
    pygame.joystick.get_count.return_value = 0
    pad = SdlGamepad(pygame, Teleop())
    for _ in range(2 * LIST_READS + 1):
        assert pad.read() is None
    assert (pygame.joystick.quit.call_count, pygame.joystick.init.call_count) == (2, 3)


def test_a_gamepad_of_sdl_that_freezes_while_it_drives_is_released(
    pad: SdlGamepad, virtual: VirtualGamepad
) -> None:
    controls, now_ns, moved = Controls(Teleop(), Vehicle()), 0, []
    for tick in range(120):
        if tick == 1:
            virtual.press(DEADMAN)
        if 1 <= tick < 40:
            virtual.push(1, -20_000 - 100 * tick)
        request = controls.tick(pad.read(), now_ns)
        moved.append(bool(request and request.linear))
        now_ns += 50_000_000
    assert moved == [False] * 2 + [True] * (38 + 40) + [False] * 40  # 2 s after its last change


def test_the_deadman_alone_moves_nothing_on_a_pad_with_triggers(
    pad: SdlGamepad, virtual: VirtualGamepad
) -> None:
    """Axes 3 and 4 are triggers: SDL reads 0 until the first report, then -1."""
    controls, now_ns = Controls(Teleop(), Vehicle()), 0
    for tick in range(60):
        virtual.push(3, -32_768 if tick >= 10 else 0)
        virtual.push(4, -32_768 if tick >= 10 else 0)
        virtual.press(DEADMAN, down=tick >= 10)
        request = controls.tick(pad.read(), now_ns)
        assert request is None or (request.linear, request.angular) == (0.0, 0.0)
        now_ns += 50_000_000
    assert pad.ignored == {3: -1.0}
