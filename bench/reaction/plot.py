"""The part ``reaction`` as a picture: how large a share took longer, against the time."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bench.reaction.page import LOADS
from bench.series import Series


def draw(file: Path, series: Sequence[Series]) -> None:
    """Draw the quiet machine left and the busy one right."""
    figure = Figure(figsize=(13, 5), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, load in zip(figure.subplots(1, 2, sharex=True, sharey=True), LOADS, strict=True):
        for one in series:
            if one.name[1] == load:
                times = sorted(one.samples_ns)
                count = len(times)
                left = [(count - number) / count for number in range(count)]
                axes.plot([ns / 1000 for ns in times], left, label=one.name[0])
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_title(load)
        axes.set_xlabel("contact to BREAK, us")
        axes.grid(alpha=0.3)
    figure.axes[0].set_ylabel("share that took longer")
    figure.axes[0].legend(fontsize=8)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)
