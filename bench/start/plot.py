"""Plot of the benchmark ``start``: medians as bars, p90 as a line."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bench.series import Series
from bench.start.page import MEMORY, TARGET_MS


def draw(file: Path, series: Sequence[Series]) -> None:
    """Draw the fastest on top, and the target of the first STOP."""
    starts = sorted(
        (each for each in series if each.name[0] != MEMORY), key=lambda one: -one.p50_ns
    )
    figure = Figure(figsize=(9, 4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    names = [", ".join(each.name).replace("`", "") for each in starts]
    medians = [each.p50_ns / 1e6 for each in starts]
    late = [each.percentile_ns(0.9) / 1e6 - each.p50_ns / 1e6 for each in starts]
    axes.barh(names, medians, xerr=[[0.0] * len(late), late], color="0.7")
    axes.axvline(TARGET_MS, linestyle="--", color="tab:red")
    axes.set_xlabel("from the start, ms")
    axes.grid(axis="x", alpha=0.3)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)
