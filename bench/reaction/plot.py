"""Plot of all responders under both loads: the share of samples that took longer, over time."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bench.reaction.responders import LOADS
from bench.series import Series

COLOURS = 10  # then repeated in the next style
STYLES = "-", "--", ":"


def draw(file: Path, series: Sequence[Series]) -> None:
    """Draw the quiet host on the left, the busy one on the right."""
    figure = Figure(figsize=(15, 5), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, load in zip(figure.subplots(1, 2, sharex=True, sharey=True), LOADS, strict=True):
        lines(axes, [one for one in series if one.name[1] == load])
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_title(load)
        axes.set_xlabel("contact to BRAKE, us")
        axes.grid(alpha=0.3)
    figure.axes[0].set_ylabel("share that took longer")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside right upper")
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)


def lines(axes: Axes, series: Sequence[Series]) -> None:
    """Draw a line for each row."""
    for number, one in enumerate(series):
        times = sorted(one.samples_ns)
        count = len(times)
        left = [(count - each) / count for each in range(count)]
        style = STYLES[number // COLOURS]
        axes.plot([ns / 1000 for ns in times], left, style, label=one.name[0])
