"""Terminal output of a soak: a line for each event, and the results."""

import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from cli.demo.display import results_table
from cli.demo.score import Result


class Show:
    """Prints events and results of one soak."""

    def __init__(self, seconds: float) -> None:
        self._console = Console(highlight=False, markup=False)
        self._seconds = seconds
        self._began_s = time.monotonic()

    def line(self, text: str) -> None:
        """Print a line."""
        self._console.print(text)

    def event(self, text: str) -> None:
        """Print an event with the time since the start."""
        past_s = time.monotonic() - self._began_s
        clock = f"{_clock(past_s)} of {_clock(self._seconds)}"
        self._console.print(f"{clock}  {text}", soft_wrap=True)

    def results(self, rows: Sequence[Result], files: Sequence[Path]) -> None:
        """Print the results and name the plots."""
        self._console.print(results_table(list(rows), "The soak"))
        self._console.print(f"plots: {', '.join(map(str, files))}", soft_wrap=True)


def _clock(seconds: float) -> str:
    minutes, rest = divmod(int(seconds), 60)
    return f"{minutes}:{rest:02}"
