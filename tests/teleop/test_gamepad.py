"""The gamepad, with a fake in SDL's place and, where pygame is installed, with SDL itself."""

import sys
from types import SimpleNamespace
from typing import Any

import pytest

from services.teleop.config import Teleop
from services.teleop.gamepad import NoGamepad, SdlGamepad, find
from services.teleop.mapping import Deflection, Stick

REMOVED = 1542


class FakeJoystick:
    """One gamepad: six axes, eleven buttons."""

    def __init__(self, index: int) -> None:
        self.axes = [0.0, -0.5, 0.0, 0.25, 0.0, 0.0]
        self.buttons = [False] * 11
        self.buttons[4] = True

    def get_name(self) -> str:
        return "Fake Pad"

    def get_instance_id(self) -> int:
        return 3

    def get_numaxes(self) -> int:
        return len(self.axes)

    def get_numbuttons(self) -> int:
        return len(self.buttons)

    def get_axis(self, index: int) -> float:
        return self.axes[index]

    def get_button(self, index: int) -> bool:
        return self.buttons[index]


class FakePygame:
    """As much of pygame as is used."""

    JOYDEVICEREMOVED = REMOVED
    error = RuntimeError

    def __init__(self) -> None:
        self.count = 1
        self.events: list[Any] = []
        self.made = FakeJoystick
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
    assert pad.words == "none"
    assert pad.read() == Stick(Deflection(0.5, -0.25), deadman=True, turbo=False)
    assert pad.words == "Fake Pad"


def test_what_a_gamepad_lacks_is_at_rest() -> None:
    pad = gamepad(FakePygame(), Teleop(angular_axis=9, deadman_button=20))
    assert pad.read() == Stick(Deflection(0.5, 0.0), deadman=False, turbo=False)


def test_a_lost_one_reads_as_none_and_may_come_back() -> None:
    pygame = FakePygame()
    pad = gamepad(pygame)
    pad.read()
    pygame.count, pygame.events = 0, [SimpleNamespace(type=REMOVED, instance_id=3)]
    assert pad.read() is None
    assert pad.words == "none"
    pygame.count = 1
    assert pad.read() is not None


def test_another_ones_loss_is_nothing() -> None:
    pygame = FakePygame()
    pad = gamepad(pygame)
    pad.read()
    pygame.events = [
        SimpleNamespace(type=REMOVED, instance_id=4),
        SimpleNamespace(type=1, instance_id=3),
    ]
    assert pad.read() is not None


def test_one_that_is_gone_before_it_opens_is_none() -> None:
    def gone(index: int) -> FakeJoystick:
        raise RuntimeError("Invalid joystick device number")

    pygame = FakePygame()
    pygame.made = gone  # type: ignore[assignment]
    assert gamepad(pygame).read() is None


def test_one_that_is_not_wanted_does_not_import_pygame(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)  # importing it would fail
    pad = find(Teleop(gamepad=False))
    assert isinstance(pad, NoGamepad)
    assert (pad.words, pad.read()) == ("off", None)


def test_without_pygame_a_line_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    assert find(Teleop()).words == "none: pygame-ce is not installed"


def test_without_sdl_a_line_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise RuntimeError("no joystick subsystem")

    pygame = FakePygame()
    pygame.joystick.init = fail
    monkeypatch.setitem(sys.modules, "pygame", pygame)
    assert find(Teleop()).words == "none: no joystick subsystem"


def test_sdl_itself_starts_without_display_and_in_silence(
    capfd: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("pygame")
    pad = find(Teleop())
    assert isinstance(pad, SdlGamepad)
    pad.read()
    assert capfd.readouterr() == ("", "")
