"""Which gamepad drives, which of its axes count, and whether its reading changes."""

import math

import pytest

from services.teleop.config import Teleop
from services.teleop.core.controls import Deflection, Stick
from services.teleop.core.pads import Pads, Reading, is_usable

SETTINGS = Teleop()  # axes 1 and 3, button 4


def reading(linear: float = 0.0, angular: float = 0.0, *, deadman: bool = False) -> Reading:
    return Reading((0.0, linear, 0.0, angular), (0, 0, 0, 0, int(deadman)))


def held(linear: float = 0.0, angular: float = 0.0) -> Reading:
    return reading(linear, angular, deadman=True)


def pushes(*readings: Reading) -> list[tuple[float, float]]:
    """Return the deflections of one device, reading by reading."""
    pads, found = Pads(SETTINGS), []
    for each in readings:
        stick = pads.update({0: each})
        assert stick is not None
        found.append((stick.push.linear, stick.push.angular))
    return found


@pytest.mark.parametrize(
    ("before", "pressed", "counts"),
    [
        (0.0, 0.0, True),
        (-1.0, 0.05, True),  # an end until the first report
        (-1.0, SETTINGS.deadzone, True),
        (SETTINGS.deadzone, -0.8, True),
        (0.0, -0.95, False),
        (0.0, -0.8, True),  # stick and deadman moved together
        (-1.0, -1.0, False),  # a trigger at rest
        (0.0, -1.0, False),  # 0 until the first report
        (0.2, 0.2, False),  # a worn stick
        (0.5, 0.5, False),  # deflected by a hand
        (0.0, math.nan, False),
        (0.0, math.inf, False),
    ],
)
def test_an_axis_counts_if_it_is_centred_when_the_deadman_goes_down(
    before: float, pressed: float, counts: bool
) -> None:
    up, down = reading(angular=before), held(angular=pressed)
    for later in (0.0, 0.5):  # passing through the centre changes nothing
        assert pushes(up, down, held(), held(angular=later))[-1][1] == (-later if counts else 0.0)
    assert pushes(up, down, reading(), held(), held(angular=0.5))[-1][1] == -0.5  # the next press


def test_an_axis_that_is_no_number_is_ignored_until_the_next_press() -> None:
    moved = pushes(
        reading(math.nan),
        reading(),
        held(0.5),
        held(math.nan),
        held(0.5),
        reading(),
        held(),
        held(0.5),
    )
    assert [linear for linear, _ in moved] == [0, 0, -0.5, 0, 0, 0, 0, -0.5]
    pads = Pads(SETTINGS)
    for each in (reading(), held(0.5), held(math.inf)):
        pads.update({0: each})
    assert pads.ignored == {1: math.inf}


def test_the_ignored_axes_are_named_while_the_device_drives() -> None:
    pads = Pads(SETTINGS)
    for each in (reading(angular=-1.0), held(angular=-1.0)):
        pads.update({0: each})
    assert pads.ignored == {3: -1.0}
    pads.update({0: reading(angular=-1.0)})
    assert pads.ignored == {}


def test_a_missing_axis_is_at_rest() -> None:
    pads = Pads(SETTINGS)
    assert pads.driving is None
    for deadman in (0, 1):
        stick = pads.update({0: Reading((0.0, -0.5 * deadman, 0.0), (0, 0, 0, 0, deadman))})
    assert stick == Stick(Deflection(0.5, 0.0), deadman=True, events=1)
    assert pads.ignored == {}
    assert pads.update({0: reading()}) == Stick(Deflection(), deadman=False, events=1)


def test_the_device_whose_deadman_goes_down_drives_until_it_comes_up() -> None:
    pads = Pads(SETTINGS)

    def moved(first: Reading | None, second: Reading | None) -> tuple[int | None, float]:
        devices = {number: it for number, it in ((1, first), (2, second)) if it is not None}
        stick = pads.update(devices)
        return pads.driving, stick.push.linear if stick else math.nan

    assert moved(held(-0.3), held(-0.5)) == (None, 0.0)  # both since the start
    assert moved(reading(), held(-0.5)) == (None, 0.0)
    assert moved(reading(), reading()) == (None, 0.0)
    assert moved(reading(), held(-0.5)) == (2, 0.5)
    assert moved(held(-0.3), held(-0.5)) == (2, 0.5)
    assert moved(held(-0.3), reading()) == (None, 0.0)  # pressed while the other one drove
    assert moved(reading(), reading()) == (None, 0.0)
    assert moved(held(-0.3), reading()) == (1, 0.3)
    assert moved(None, reading()) == (None, 0.0)  # unplugged
    assert moved(held(-0.3), reading()) == (None, 0.0)  # back, with the deadman held
    assert pads.update({}) is None


def test_only_the_device_that_drives_shows_that_it_lives() -> None:
    pads = Pads(SETTINGS)

    def events(angular: float, other: float) -> int:
        stick = pads.update({1: held(0.5, angular), 2: reading(other)})
        assert stick is not None
        return stick.events

    pads.update({1: reading(), 2: reading()})
    assert [events(angular, other) for angular, other in (
        (0.0, 0.0), (0.0, 0.5), (0.001, -0.5), (0.0, 0.5), (0.002, 0.0),
    )] == [1, 1, 1, 1, 2]  # fmt: skip


@pytest.mark.parametrize(
    ("axes", "buttons", "usable"),
    [(6, 11, True), (2, 5, True), (1, 11, False), (6, 4, False), (0, 40, False)],
)
def test_a_usable_device_has_one_of_the_axes_and_the_deadman(
    axes: int, buttons: int, usable: bool
) -> None:
    assert is_usable(SETTINGS, axes, buttons) is usable
