"""The vehicle from above in characters, with the readings of its eight sonars.

::

              1.42 m            Each sonar has one arc per band of distance. The arc of its
      -     ━━━━━━━━━    0.80 m reading is lit in the band's colour; "fault" and "near" light
         ╱   ━━━━━━━   ╲        all of its arcs.
           █╭───────╮█
       ┃ ┃  │   ▲   │  ┃ ┃
    -  ┃ ┃  │       │  ┃ ┃  2.10 m
"""

from itertools import groupby
from operator import itemgetter
from typing import NamedTuple

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


class Reading(NamedTuple):
    """A sonar's reading, ready to draw: label, colour and lit arcs."""

    label: str
    style: str
    lit: range = range(0)  # 0 is the nearest band


def reading(distance: float | None, status: RangeStatus) -> Reading:
    """Return how a sonar's reading (metres) is drawn."""
    if status == "fault":
        return Reading("fault", FAULT, range(len(BANDS)))
    if status == "too_near":
        return Reading("near", BANDS[0][1], range(len(BANDS)))
    if status == "no_echo" or distance is None:
        return Reading(UNKNOWN, DIM)
    for band, (end, style) in enumerate(BANDS):
        if distance < end:
            return Reading(f"{distance:.2f} m", style, range(band, band + 1))
    return Reading(f"{distance:.2f} m", FAR)


def around(
    ultrasonic: Ultrasonic | None, bumper: Bumper | None, width: int = 38, height: int = 11
) -> Text:
    """Return the sonar view, ``width`` by ``height`` characters; "?" without a fresh message."""
    view = SonarView(width, height)
    view.draw_body(bumper is not None and bumper.pressed)
    for at, name in enumerate(SONAR_NAMES):
        shown = Reading("?", DIM)
        if ultrasonic is not None:
            shown = reading(ultrasonic.ranges[at], ultrasonic.status[at])
        view.draw_sonar(*SONARS[name], shown)
    return view.text()


class SonarView:
    """A grid of styled characters; text outside of it is clipped."""

    def __init__(self, width: int, height: int) -> None:
        self._cells = [[(" ", "")] * width for _ in range(height)]
        self._middle = width // 2  # column of the vehicle's centre
        self._top = (height - len(BODY)) // 2  # row of its front
        # A row, or six columns, are for the labels.
        self._bands = max(1, min(len(BANDS), self._top - 1, (self._middle - 13) // 2))

    def draw_body(self, is_hit: bool) -> None:
        """Draw the vehicle."""
        style, label = (HIT, "BUMPER") if is_hit else ("bold cyan", "T2")
        left = self._middle - len(BODY[0]) // 2
        for row, line in enumerate(BODY, self._top):
            self._put(row, left, line, style)
        self._put(self._top + 2, left + (len(BODY[0]) - len(label)) // 2, label, style)

    def draw_sonar(self, ahead: int, side: int, shown: Reading) -> None:
        """Draw the arcs of a sonar, the nearest first, and its label beside the outermost."""
        for band in range(self._bands):
            style = shown.style if band in shown.lit else DIM
            row, column = self._row(ahead, band), self._middle + side * (7 + 2 * band)
            if not side:
                self._put(row, self._middle - 3 - band, "━" * (7 + 2 * band), style)
            elif ahead:
                self._put(row, column, "╱" if ahead == side else "╲", style)
            else:
                for each in range(1, len(BODY) - 1):
                    self._put(self._top + each, column, "┃", style)
        gap, length = 7 + 2 * self._bands, len(shown.label)
        if side:
            row = self._row(ahead, self._bands - 1) if ahead else self._top + 2
            column = self._middle + (gap if side > 0 else 1 - gap - length)
        else:
            row, column = self._row(ahead, self._bands), self._middle - length // 2
        self._put(row, column, shown.label, shown.style)

    def text(self) -> Text:
        """Return all lines."""
        return Text("\n", no_wrap=True).join(
            Text.assemble(
                *(
                    ("".join(cell[0] for cell in run), style)
                    for style, run in groupby(row, itemgetter(1))
                )
            )
            for row in self._cells
        )

    def _row(self, ahead: int, band: int) -> int:
        """Return the row at ``band`` rows from the front or the rear."""
        return self._top - 1 - band if ahead < 0 else self._top + len(BODY) + band

    def _put(self, row: int, column: int, text: str, style: str) -> None:
        for at, character in enumerate(text, column):
            if 0 <= row < len(self._cells) and 0 <= at < len(self._cells[0]):
                self._cells[row][at] = (character, style)
