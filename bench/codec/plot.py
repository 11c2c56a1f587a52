"""The part ``codec`` as a picture: a dot at the median, a whisker up to p99."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bench.codec.page import WAYS, codecs
from bench.codec.values import FRAMES, MESSAGES
from bench.series import Series


def draw(file: Path, series: Sequence[Series]) -> None:
    """Draw frames above and messages below, encoding left and decoding right."""
    by_name = {each.name: each for each in series}
    figure = Figure(figsize=(13, 9), layout="constrained")
    FigureCanvasAgg(figure)
    lines = figure.subplots(2, 2, sharey="row")
    for line, names in zip(lines, (list(FRAMES), list(MESSAGES)), strict=True):
        for axes, way in zip(line, WAYS, strict=True):
            _dots(axes, by_name, names, way)
        line[1].legend(loc="center left", bbox_to_anchor=(1, 0.5))
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)


def _dots(
    axes: Axes, by_name: Mapping[tuple[str, ...], Series], names: Sequence[str], way: str
) -> None:
    labels = codecs(by_name, names[0])
    width = 0.8 / len(labels)
    for number, codec in enumerate(labels):
        of = [by_name[name, codec, way] for name in names]
        middles = [each.p50_ns / 1000 for each in of]
        above = [each.p99_ns / 1000 - middle for each, middle in zip(of, middles, strict=True)]
        at = [place + (number - (len(labels) - 1) / 2) * width for place in range(len(names))]
        axes.errorbar(at, middles, [[0.0] * len(of), above], fmt="o", capsize=2, label=codec)
    axes.set_xticks(range(len(names)), names, fontsize=8)
    axes.set_yscale("log")
    axes.set_ylabel("us a call: dot p50, whisker p99")
    axes.set_title(way)
    axes.grid(axis="y", alpha=0.3)
