"""Plot of a fleet: cost of the site's router and latency of requests over the number of robots."""

from collections.abc import Callable, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from verification.fleet.figures import Window, limits, name, on_the_wire
from verification.harness.results import percentile

Value = Callable[[Window], float | None]


def save(file: Path, windows: Sequence[Window]) -> None:
    """Write the plot to a file."""
    figure = Figure(figsize=(11, 8), layout="constrained")
    FigureCanvasAgg(figure)
    (cpu, memory), (latency, uplink) = figure.subplots(2, 2)
    _lines(cpu, windows, lambda w: 100 * float(w["site"]["cpu"]))
    _lines(memory, windows, lambda w: float(w["site"]["rss"]) / 1e6)
    _lines(latency, windows, lambda w: _p99(w["answers_s"]), marked=True)
    _lines(uplink, windows, lambda w: on_the_wire(w["real_link"], "up") * 8 / 1000)
    cpu.set_ylabel("site router, % of a core")
    memory.set_ylabel("site router, MB")
    latency.set_ylabel("request to frame, p99, ms\n(hollow: generator or machine saturated)")
    latency.set_yscale("log")
    uplink.set_ylabel("uplink of a real robot, kbit/s")
    cpu.legend(title="subscribed", fontsize=8)
    for axes in (cpu, memory, latency, uplink):
        axes.set_xlabel("robots")
        axes.grid(alpha=0.3)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)


def _lines(axes: Axes, windows: Sequence[Window], value: Value, marked: bool = False) -> None:
    for number, label in enumerate(dict.fromkeys(map(name, windows))):
        rows = [window for window in windows if name(window) == label]
        points = [(w["robots"], y) for w in rows if (y := value(w)) is not None]
        color = f"C{number}"
        axes.plot(*zip(*points, strict=True), color=color, label=label)
        for window in rows:
            hollow = marked and limits(window)
            y = value(window)
            if y is not None:
                face = "white" if hollow else color
                axes.plot(window["robots"], y, "o", color=color, markerfacecolor=face)


def _p99(answers: Sequence[float | None]) -> float | None:
    took = [each for each in answers if each is not None]
    return 1000 * percentile(took, 0.99) if took else None
