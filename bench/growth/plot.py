"""Plot of the benchmark ``growth``: CPU above, delay below, logarithmic axes."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bench.growth.page import COSTS, CURVES, bend, points
from bench.series import Series

LEAST = 0.1  # % of a core; smaller values are drawn as this


def draw(file: Path, series: Sequence[Series]) -> None:
    """Draw a column for each curve; a dotted line is where one bends."""
    by_name = {each.name: each for each in series}
    figure = Figure(figsize=(16, 7), layout="constrained")
    FigureCanvasAgg(figure)
    above, below = figure.subplots(2, len(CURVES), sharex="col", sharey="row")
    for curve, cpu, delay in zip(CURVES, above, below, strict=True):
        for number, process in enumerate(COSTS):
            shares = [(n, max(ns / 1e7, LEAST)) for n, ns in points(by_name, curve, process)]
            _line(cpu, shares, f"C{number}", process)
        for color, share in (("C2", 0.5), ("C3", 0.99)):
            times = [(n, ns / 1000) for n, ns in points(by_name, curve, "delay", share)]
            _line(delay, times, color, f"p{100 * share:.0f}")
        delay.set_xlabel(curve)
        for axes in (cpu, delay):
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.grid(alpha=0.3)
    above[0].set_ylabel("CPU, % of a core")
    below[0].set_ylabel("delay, us")
    above[0].legend()
    below[0].legend()
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)


def _line(axes: Axes, curved: Sequence[tuple[float, float]], color: str, label: str) -> None:
    if not curved:
        return
    axes.plot(*zip(*curved, strict=True), "o-", color=color, label=label, markersize=4)
    at = bend(curved)
    if at is not None:
        axes.axvline(at, color=color, linestyle=":")
