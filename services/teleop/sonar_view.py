"""The vehicle from above in characters, with the readings of its eight sonars.

::

              1.42 m            Each sonar has one arc per band of distance. The arc of its
      -     ━━━━━━━━━    0.80 m reading is lit in the band's colour; "fault" and "near" light
         ╱   ━━━━━━━   ╲        all of its arcs.
           █╭───────╮█
       ┃ ┃  │   ▲   │  ┃ ┃
    -  ┃ ┃  │       │  ┃ ┃  2.10 m
"""

from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter

from rich.text import Text

from common.messages import SONAR_NAMES, Bumper, RangeStatus, Ultrasonic

# End of each band, in metres, and its colour. For display only: the distances at which safety acts
# depend on the speed.
BANDS = ((0.5, "bold red"), (1.0, "bold yellow"), (2.0, "green"))
FAR = "green"
DIM = "grey35"
FAULT = "bold magenta"
UNKNOWN = "-"

HIT = "bold white on red"
# -1 is ahead, 1 behind; -1 is left, 1 right.
SONARS = {
    "front": (-1, 0), "rear": (1, 0), "left": (0, -1), "right": (0, 1),
    "front_left": (-1, -1), "front_right": (-1, 1), "rear_left": (1, -1), "rear_right": (1, 1),
}  # fmt: skip

BODY = (
    "█╭───────╮█",
    " │   ▲   │ ",
    " │       │ ",
    " │       │ ",
    "█╰───────╯█",
)
BODY_WIDTH, BODY_HEIGHT = len(BODY[0]), len(BODY)


@dataclass(frozen=True, slots=True)
class Reading:
    """A sonar's reading, ready to draw: label, colour and lit arcs."""

    label: str
    style: str
    lit: frozenset[int]  # 0 is the nearest band


@dataclass(frozen=True, slots=True)
class Plan:
    """Positions on the canvas; ``ahead`` and ``side`` as in ``SONARS``."""

    middle: int  # column of the vehicle's centre
    top: int  # row of its front
    bands: int  # arcs that fit

    def row(self, ahead: int, band: int) -> int:
        """Return the row at ``band`` rows from the front or the rear."""
        return self.top - 1 - band if ahead < 0 else self.top + BODY_HEIGHT + band

    def arc(self, ahead: int, side: int, band: int) -> list[tuple[int, int, str]]:
        """Return row, column and text of each part of a sonar's arc."""
        row, column = self.row(ahead, band), self.middle + side * (7 + 2 * band)
        if not side:
            return [(row, self.middle - 3 - band, "━" * (7 + 2 * band))]
        if ahead:
            return [(row, column, "╱" if ahead == side else "╲")]
        return [(self.top + each, column, "┃") for each in range(1, BODY_HEIGHT - 1)]

    def label(self, ahead: int, side: int, label: str) -> tuple[int, int]:
        """Return row and column of a label beside a sonar's outermost arc."""
        if not side:
            return self.row(ahead, self.bands), self.middle - len(label) // 2
        row = self.row(ahead, self.bands - 1) if ahead else self.top + 2
        gap = 7 + 2 * self.bands
        return row, self.middle + gap if side > 0 else self.middle - gap - len(label) + 1


class Canvas:
    """A grid of styled characters; text outside of it is clipped."""

    def __init__(self, width: int, height: int) -> None:
        self._cells = [[(" ", "")] * width for _ in range(height)]

    def put(self, row: int, column: int, text: str, style: str) -> None:
        """Write a text from left to right."""
        for at, character in enumerate(text, column):
            if 0 <= row < len(self._cells) and 0 <= at < len(self._cells[0]):
                self._cells[row][at] = (character, style)

    def text(self) -> Text:
        """Return all lines."""
        return Text("\n", no_wrap=True).join(self._line(row) for row in self._cells)

    @staticmethod
    def _line(row: list[tuple[str, str]]) -> Text:
        runs = groupby(row, key=itemgetter(1))
        return Text.assemble(*(("".join(cell[0] for cell in run), style) for style, run in runs))


def reading(distance: float | None, status: RangeStatus) -> Reading:
    """Return how a sonar's reading (metres) is drawn."""
    all_arcs = frozenset(range(len(BANDS)))
    if status == "fault":
        return Reading("fault", FAULT, all_arcs)
    if status == "too_near":
        return Reading("near", BANDS[0][1], all_arcs)
    if status == "no_echo" or distance is None:
        return Reading(UNKNOWN, DIM, frozenset())
    for band, (end, style) in enumerate(BANDS):
        if distance < end:
            return Reading(f"{distance:.2f} m", style, frozenset({band}))
    return Reading(f"{distance:.2f} m", FAR, frozenset())


def readings(ultrasonic: Ultrasonic | None) -> dict[str, Reading]:
    """Return all eight readings by name; unknown without a fresh message."""
    if ultrasonic is None:
        return {name: Reading("?", DIM, frozenset()) for name in SONAR_NAMES}
    seen = zip(SONAR_NAMES, ultrasonic.ranges, ultrasonic.status, strict=True)
    return {name: reading(distance, status) for name, distance, status in seen}


def around(
    ultrasonic: Ultrasonic | None, bumper: Bumper | None, width: int = 38, height: int = 11
) -> Text:
    """Return the sonar view, ``width`` by ``height`` characters."""
    top = (height - BODY_HEIGHT) // 2
    room = min(top - 1, (width // 2 - 13) // 2)  # a row, or six columns, for the labels
    plan = Plan(width // 2, top, max(1, min(len(BANDS), room)))
    canvas = Canvas(width, height)
    seen = readings(ultrasonic)
    _body(canvas, plan, bumper)
    for name, at in SONARS.items():
        _sonar(canvas, plan, at, seen[name])
    return canvas.text()


def _body(canvas: Canvas, plan: Plan, bumper: Bumper | None) -> None:
    hit = bumper is not None and bumper.pressed
    style = HIT if hit else "bold cyan"
    left = plan.middle - BODY_WIDTH // 2
    for row, line in enumerate(BODY):
        canvas.put(plan.top + row, left, line, style)
    label = "BUMPER" if hit else "T2"
    canvas.put(plan.top + 2, left + (BODY_WIDTH - len(label)) // 2, label, style)


def _sonar(canvas: Canvas, plan: Plan, at: tuple[int, int], sonar: Reading) -> None:
    ahead, side = at
    for band in range(plan.bands):
        style = sonar.style if band in sonar.lit else DIM
        for row, column, text in plan.arc(ahead, side, band):
            canvas.put(row, column, text, style)
    row, column = plan.label(ahead, side, sonar.label)
    canvas.put(row, column, sonar.label, sonar.style)
