"""What is shown of a lap: a live picture on a terminal, a line a step elsewhere, the results."""

from collections.abc import Sequence
from pathlib import Path
from typing import Self

from rich.console import Console
from rich.live import Live

from cli.demo import plot
from cli.demo.driver import Driver
from cli.demo.picture import Canvas, picture, results_table
from cli.demo.score import Result, Trace
from cli.demo.script import Step
from common.messages import Odometry
from common.settings import Vehicle
from sim.geometry import Rectangle
from sim.world import Plan


class Show:
    """Shows one lap; a context, because the live picture must give the terminal back."""

    def __init__(self, plan: Plan, vehicle: Vehicle, out: Path) -> None:
        self._plan = plan
        self._body = Rectangle(vehicle.length / 2, vehicle.width / 2)
        self._out = out
        self._console = Console(highlight=False, markup=False)  # brackets are brackets
        self._canvas = Canvas(plan, self._console.width)
        self._live = Live(console=self._console, auto_refresh=False, transient=True)

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._live.start()
        else:
            self._console.print("starting simulator, router, bridge, safety and odometry")
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def say(self, text: str) -> None:
        """Print a sentence."""
        self._console.print(text)

    def step(self, step: Step) -> None:
        """Tell that a step begins."""
        if not self._console.is_terminal:
            self._console.print(f"  {step.name}")

    def draw(self, driver: Driver, now_ns: int) -> None:
        """Draw one moment."""
        if self._console.is_terminal:
            self._live.update(picture(self._canvas, driver, now_ns), refresh=True)

    def results(self, rows: Sequence[Result], driver: Driver) -> None:
        """Print the results, and what safety answered."""
        for step, press, granted, words in driver.answers:
            said = "granted" if granted else "refused"
            self._console.print(f"{step}: {press} {said}: {words}")
        self._console.print(results_table(list(rows)))

    def plot(self, trace: Trace, odometry: Sequence[Odometry]) -> None:
        """Draw the lap into files and name them."""
        files = [self._out / "lap.png", self._out / "lap.svg"]
        plot.save(files, self._plan, self._body, trace, odometry)
        self._console.print(f"plots: {', '.join(map(str, files))}", soft_wrap=True)
