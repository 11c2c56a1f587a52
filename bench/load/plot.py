"""Plot of the benchmark ``load``: the delay up to the first rate with a loss, and CPU shares."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bench.load.page import BARE, BUS, CHAIN, FRAMES_HZ, TOGETHER, ByName, consumers, middle, tried
from bench.series import Series

READABLE = 2.0  # % of a core; a smaller bar has no room for its name
LABEL = 18  # characters in a line below a bar


def draw(file: Path, series: Sequence[Series]) -> None:
    """Draw the rates on the left, the CPU on the right."""
    by_name = {each.name: each for each in series}
    figure = Figure(figsize=(13, 5), layout="constrained")
    FigureCanvasAgg(figure)
    rates, cpu = figure.subplots(1, 2)
    _rates(rates, by_name)
    _cpu(cpu, by_name)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)


def _rates(axes: Axes, by_name: ByName) -> None:
    for number, count in enumerate(consumers(by_name)):
        found = sorted((hz, one) for hz, one in tried(by_name, count).items() if one.samples_ns)
        delays = [one.p99_ns / 1e6 for _, one in found]
        color = f"C{number}"
        axes.plot([hz for hz, _ in found], delays, color=color, label=f"to {count}")
        for (hz, one), delay in zip(found, delays, strict=True):
            axes.plot(hz, delay, "o", color=color, markerfacecolor="white" if one.note else color)
    axes.axvline(FRAMES_HZ, color="gray", linestyle=":")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("frames a second (hollow: not all arrived; dotted: target)")
    axes.set_ylabel("bridge to consumer, p99, ms")
    axes.legend(title="consumers", fontsize=8)
    axes.grid(alpha=0.3)


def _cpu(axes: Axes, by_name: ByName) -> None:
    rates = ("shipped", "tenfold")
    bars = [(candidate, rate) for rate in rates for candidate in (CHAIN, BARE, BUS)]
    for at, (candidate, rate) in enumerate(bars):
        bottom = 0.0
        names = [
            name[2] for name in by_name if name[:2] == (candidate, rate) and name[2] != TOGETHER
        ]
        for name in names:
            share = middle(by_name, candidate, rate, name) / 1e7
            axes.bar(at, share, bottom=bottom, edgecolor="white", color=f"C{names.index(name)}")
            if share > READABLE:
                axes.annotate(name, (at, bottom + share / 2), ha="center", va="center", fontsize=7)
            bottom += share
    labels = [fill(f"{candidate}, {rate}", LABEL) for candidate, rate in bars]
    axes.set_xticks(range(len(bars)), labels, fontsize=8)
    axes.set_ylabel("CPU, % of a core")
    axes.grid(axis="y", alpha=0.3)
