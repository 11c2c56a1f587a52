"""Plot of a soak: memory, log and steps over time, with the faults."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from verification.soak.record import Record

DISTURBED, KILLED = "#b0bec5", "#c62828"
MB = 2**20


def save(files: Sequence[Path], record: Record) -> None:
    """Write the plot to each file, in the format of its suffix."""
    figure = Figure(figsize=(11, 9), layout="constrained")
    FigureCanvasAgg(figure)
    memory, held, progress = figure.subplots(3, 1, sharex=True, height_ratios=[3, 2, 2])
    _draw_lives(memory, held, record)
    _draw_progress(progress, record)
    for axes in (memory, held, progress):
        _draw_faults(axes, record)
        axes.grid(alpha=0.3)
    for file in files:
        figure.savefig(file, dpi=110)


def _draw_lives(memory: Axes, held: Axes, record: Record) -> None:
    """Draw each process in its own colour, with gaps while it did not run."""
    names = list(dict.fromkeys(run.name for run in record.lives))
    drawn = set()
    for run, samples in record.lives.items():
        color = f"C{names.index(run.name) % 10}"
        times = [sample.at_s for sample in samples]
        label = None if run.name in drawn else run.name
        drawn.add(run.name)
        memory.plot(times, [sample.rss / MB for sample in samples], label=label, color=color)
        held.plot(times, [sample.threads for sample in samples], color=color)
        held.plot(times, [sample.descriptors for sample in samples], linestyle=":", color=color)
    memory.set_title("A soak of T2: grey is a fault, red a kill -9")
    memory.set_ylabel("resident memory, MB")
    memory.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    held.set_ylabel("threads (solid),\ndescriptors (dotted)")


def _draw_progress(axes: Axes, record: Record) -> None:
    axes.plot([at_s for at_s, _ in record.log], [size / 1000 for _, size in record.log],
              color="C0", label="log, kB")  # fmt: skip
    axes.set_ylabel("log, kB")
    axes.set_xlabel("time, s")
    steps = [one.at_s for one in record.progress if one.what == "step"]
    laps = [one.at_s for one in record.progress if one.what == "lap finished"]
    right = axes.twinx()
    right.step(steps, range(1, len(steps) + 1), where="post", color="C2", label="steps done")
    right.plot(laps, [sum(step <= lap for step in steps) for lap in laps], "o", color="C2",
               label="lap finished")  # fmt: skip
    right.set_ylabel("steps done")
    right.legend(loc="upper left", fontsize=8)


def _draw_faults(axes: Axes, record: Record) -> None:
    for at_s, name in record.faults:
        color = KILLED if name.startswith("kill ") else DISTURBED
        axes.axvline(at_s, color=color, linewidth=0.8, zorder=0)
