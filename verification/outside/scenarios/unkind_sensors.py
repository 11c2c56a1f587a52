"""Unkind sonars and bumpers, each permitted by the manual: group 20."""

import time

from verification.outside.board import Board, Faults
from verification.outside.course import COURSE, Findings, course, stands, text
from verification.outside.sonars import Ring
from verification.outside.testbed import Prepare, Result, Testbed, fitted, scenario
from verification.outside.vehicle import Motors

BRISK = 0.7  # m/s: false echoes limit slow motion less
LEFT = 0


def sonars(ring: Ring) -> Prepare:
    def prepare(board: Board) -> None:
        board.ring = ring

    return prepare


@scenario(20, "sonars resolve 1 cm", COURSE, prepare=sonars(Ring(resolution_mm=10, noise_mm=5)))
def profile_centimetre_sonar(bed: Testbed) -> Result:
    return course(bed, BRISK).result()


@scenario(20, "sonars saturate at 3 m", COURSE, prepare=sonars(Ring(longest_mm=3000)))
def profile_short_sonar(bed: Testbed) -> Result:
    return course(bed, BRISK).result()


@scenario(
    20,
    "one reading in 50 is an echo of the floor at 0.6 m; 0.7 m/s",
    COURSE,
    prepare=sonars(Ring(floor=0.02, floor_mm=600, noise_mm=5)),
)
def profile_floor_echo(bed: Testbed) -> Result:
    return course(bed, BRISK).result()


@scenario(
    20,
    "a wall at 0.6 m on the left; one reading in 20 is that of a neighbour",
    COURSE,
    prepare=sonars(Ring(crossed=0.05, noise_mm=5)),
)
def profile_cross_talk(bed: Testbed) -> Result:
    bed.board.sonars[LEFT] = 600
    return course(bed, 0.4).result()


@scenario(
    20,
    "echoes vanish for 0.2 s, 12 times a minute",
    COURSE,
    prepare=sonars(Ring(absorbed=0.01, absorbed_readings=4, noise_mm=5)),
)
def profile_soft_target(bed: Testbed) -> Result:
    return course(bed, BRISK).result()


@scenario(
    20,
    "the bumper's switch bounces for 60 ms; released backward for 3 s after the course",
    COURSE + "; comes off the obstacle, and can be reset",
    faults=lambda: Faults(bounce=0.06),
)
def profile_bouncing_bumper(bed: Testbed) -> Result:
    found = course(bed)
    comes_off(bed, found)
    return found.result()


@scenario(
    20,
    "the body rebounds with a third of its speed; released backward for 3 s after the course",
    COURSE + "; comes off the obstacle, and can be reset",
    prepare=fitted(Motors(rebound=0.33)),
)
def profile_rebound(bed: Testbed) -> Result:
    found = course(bed)
    comes_off(bed, found)
    return found.result()


def comes_off(bed: Testbed, found: Findings) -> None:
    """Release backward after a contact, then reset."""
    board = bed.board
    stands(bed)
    refusals = bed.operator.hold_release("backward", 3.0)
    time.sleep(0.5)
    gap = (board.wall or 0.0) - board.vehicle.distance
    why = f" ({refusals[-1]})" if refusals else ""
    found.add(f"released: {gap * 100:.1f} cm off{why}", gap > 0.005)
    done = bed.operator.reset()
    found.add("reset" if done else f"no reset: {text(bed)}", done)
