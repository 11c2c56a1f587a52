"""Plot of the campaign: duration, distance, errors of odometry and NEES."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from verification.vehicles.run import Result


def save(file: Path, results: Sequence[Result]) -> None:
    """Write the plot to a file."""
    sound = [result for result in results if not result.faulty]
    faulty = [result for result in results if result.faulty]
    figure = Figure(figsize=(11, 6), layout="constrained")
    FigureCanvasAgg(figure)
    (lasted, driven), (error, nees) = figure.subplots(2, 2)
    names = ["no fault", "with faults"]
    lasted.hist([[one.seconds for one in chosen] for chosen in (sound, faulty)], 40, label=names)
    lasted.set_xlabel("duration of a run, s")
    lasted.legend()
    driven.hist([[one.metres for one in chosen] for chosen in (sound, faulty)], 40, label=names)
    driven.set_xlabel("driven, m")
    driven.legend()
    last = [result.errors[-1] for result in sound if result.errors]
    error.hist([1000 * one.position for one in last], bins=60)
    error.set_xlabel("position error of odometry at the end, mm")
    nees.hist([one.nees for one in last], bins=60, log=True)
    nees.axvline(7.81, color="C3", label="95 % of honest runs")
    nees.set_xlabel("NEES at the end")
    nees.legend()
    for axes in (lasted, driven, error, nees):
        axes.set_ylabel("runs")
        axes.grid(alpha=0.3)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)
