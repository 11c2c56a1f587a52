"""The gamepad, with a fake SDL and, if pygame is installed, with SDL."""

import ctypes
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from services.teleop.config import Teleop
from services.teleop.core.controls import Controls, Deflection, Stick
from services.teleop.gamepad import SdlGamepad, find

MAPS = Path("/proc/self/maps")
REMOVED = 1542
AXIS, BALL, HAT, DOWN, UP = range(1536, 1541)


def event(kind: int, joystick: int = 3) -> SimpleNamespace:
    return SimpleNamespace(type=kind, instance_id=joystick)


class FakeJoystick:
    """One gamepad: six axes, eleven buttons."""

    def __init__(self, index: int) -> None:
        self.axes = [0.0, -0.5, 0.0, 0.25, 0.0, 0.0]
        self.get_name = lambda: "Fake Pad"
        self.get_instance_id = lambda: 3
        self.get_numaxes = lambda: len(self.axes)
        self.get_numbuttons = lambda: 11
        self.get_axis = lambda index: self.axes[index]
        self.get_button = lambda index: index == 4


class FakePygame:
    """The used part of pygame."""

    JOYDEVICEREMOVED = REMOVED
    JOYAXISMOTION, JOYBALLMOTION, JOYHATMOTION = AXIS, BALL, HAT
    JOYBUTTONDOWN, JOYBUTTONUP = DOWN, UP
    error = RuntimeError

    def __init__(self) -> None:
        self.count = 1
        self.events: list[Any] = []
        self.made: Any = FakeJoystick
        self.display = SimpleNamespace(init=lambda: None)
        self.event = SimpleNamespace(get=self._get)
        self.joystick = SimpleNamespace(
            init=lambda: None, get_count=lambda: self.count, Joystick=lambda i: self.made(i)
        )

    def _get(self) -> list[Any]:
        events, self.events = self.events, []
        return events


def gamepad(pygame: FakePygame, settings: Teleop | None = None) -> SdlGamepad:
    return SdlGamepad(pygame, settings or Teleop())  # type: ignore[arg-type]


def test_sticks_and_buttons_are_read() -> None:
    pad = gamepad(FakePygame())
    assert pad.status == "none"
    assert pad.read() == Stick(Deflection(0.5, -0.25), deadman=True)
    assert pad.status == "Fake Pad"
    pad = gamepad(FakePygame(), Teleop(angular_axis=9, deadman_button=20))
    assert pad.read() == Stick(Deflection(0.5, 0.0), deadman=False)  # missing ones are at rest


def test_a_lost_gamepad_reads_as_none_and_may_return() -> None:
    pygame = FakePygame()
    pad = gamepad(pygame)
    pad.read()
    pygame.events = [event(REMOVED, joystick=4)]  # another one
    assert pad.read() is not None
    pygame.count, pygame.events = 0, [event(REMOVED)]
    assert pad.read() is None
    assert pad.status == "none"
    pygame.count = 1
    assert pad.read() is not None


def test_input_events_are_counted() -> None:
    pygame = FakePygame()
    pad, counts = gamepad(pygame), []
    for events in (
        [event(AXIS)],  # of one that is not ours yet
        [event(AXIS)],
        [event(each) for each in (BALL, HAT, DOWN, UP)],
        [event(AXIS, joystick=4)],  # another one's
        [SimpleNamespace(type=1541, guid="")],  # a gamepad was added
        [event(1616)],  # its battery
    ):
        pygame.events = list(events)
        stick = pad.read()
        assert stick is not None
        counts.append(stick.events)
    assert counts == [0, 1, 5, 5, 5, 5]


def test_a_gamepad_that_is_gone_before_it_opens_is_none() -> None:
    def gone(index: int) -> FakeJoystick:
        raise RuntimeError("Invalid joystick device number")

    pygame = FakePygame()
    pygame.made = gone
    assert gamepad(pygame).read() is None


def broken() -> None:
    raise RuntimeError("no joystick subsystem")


@pytest.mark.parametrize(
    ("pygame", "enabled", "status"),
    [
        (None, False, "off"),  # importing it would fail
        (None, True, "none: pygame-ce is not installed"),
        ("broken", True, "none: no joystick subsystem"),
    ],
)
def test_a_missing_gamepad_names_the_reason(
    monkeypatch: pytest.MonkeyPatch, pygame: Any, enabled: bool, status: str
) -> None:
    if pygame:
        pygame = FakePygame()
        pygame.joystick.init = broken
    monkeypatch.setitem(sys.modules, "pygame", pygame)
    pad = find(Teleop(gamepad=enabled))
    assert (pad.status, pad.read()) == (status, None)


# --- SDL ------------------------------------------------------------------------------------


class VirtualGamepad:
    """A virtual gamepad of SDL: six axes, eleven buttons."""

    def __init__(self) -> None:
        library = next(
            line.split()[-1] for line in MAPS.read_text().splitlines() if "libSDL2-" in line
        )
        self._sdl = ctypes.CDLL(library)
        self._sdl.SDL_JoystickOpen.restype = ctypes.c_void_p
        self.index = self._sdl.SDL_JoystickAttachVirtual(1, 6, 11, 0)
        self._handle = ctypes.c_void_p(self._sdl.SDL_JoystickOpen(self.index))

    def push(self, axis: int, value: int) -> None:
        self._sdl.SDL_JoystickSetVirtualAxis(self._handle, axis, ctypes.c_int16(value))

    def press(self, button: int) -> None:
        self._sdl.SDL_JoystickSetVirtualButton(self._handle, button, 1)

    def unplug(self) -> None:
        self._sdl.SDL_JoystickClose(self._handle)
        self._sdl.SDL_JoystickDetachVirtual(self.index)


@pytest.fixture
def virtual(
    capfd: pytest.CaptureFixture[str],
) -> Iterator[tuple[SdlGamepad, VirtualGamepad]]:
    pytest.importorskip("pygame")
    pad = find(Teleop())
    assert capfd.readouterr() == ("", "")  # without a display, and without its banner
    if not (isinstance(pad, SdlGamepad) and MAPS.exists() and "libSDL2-" in MAPS.read_text()):
        pytest.skip("SDL 2 is not available")
    gamepad = VirtualGamepad()
    yield pad, gamepad
    gamepad.unplug()
    assert pad.read() is None


def test_a_gamepad_of_sdl_that_freezes_while_it_drives_is_released(
    virtual: tuple[SdlGamepad, VirtualGamepad],
) -> None:
    pad, gamepad = virtual
    controls, now_ns, moved = Controls(Teleop()), 0, []
    for tick in range(120):
        if tick == 1:
            gamepad.press(4)
        if 1 <= tick < 40:
            gamepad.push(1, -20_000 - tick)
        request = controls.tick(pad.read(), now_ns)
        moved.append(bool(request and request.linear))
        now_ns += 50_000_000
    assert moved == [False] * 2 + [True] * (38 + 40) + [False] * 40  # 2 s after its last event
