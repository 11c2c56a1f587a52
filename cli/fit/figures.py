"""Figures of a fit, as inline SVG: stops with their lines, sonars, answers, and the check."""

from collections import Counter
from collections.abc import Sequence
from itertools import accumulate, pairwise

import ziaplot as zp

from cli.fit.check import Course
from cli.fit.stops import Stop
from cli.fit.streams import Streams
from cli.recordings.figures import MEASURED, REQUESTED, STOPPED, svg
from cli.recordings.timeline import downsampled
from common.freshness import NS_PER_S
from t2 import keys

BIN_M = 0.1  # of the histogram
HEIGHT = 320


def stops(found: Sequence[Stop], name: str) -> str:
    """Draw the velocities of stops from the command on, and the fitted lines."""
    graph = _graph("time since the command, s", f"speed, {found[0].axis.unit}/s")
    for stop in found:
        times, speeds = zip(*stop.points, strict=True)
        graph.add(zp.PolyLine(times, speeds).color(MEASURED).strokewidth(1.2))
        ends_s = stop.reaction + stop.speed / stop.deceleration
        line = zp.PolyLine([stop.reaction, ends_s], [stop.speed, 0.0])
        graph.add(line.color(STOPPED).strokewidth(1.6).stroke("--"))
    return svg(graph, HEIGHT, name)


def sonars(streams: Sequence[Streams]) -> str:
    """Draw how often each range was reported, by all sonars."""
    counts = Counter(
        round(r / BIN_M)
        for each in streams
        for sample in each.ultrasonics
        for r in sample.ranges
        if r is not None
    )
    graph = _graph("range, m", "readings")
    graph.xrange(0.0, (max(counts) + 1) * BIN_M)
    graph.yrange(0.0, float(max(counts.values())))
    for number, count in sorted(counts.items()):
        bar = zp.Rectangle((number - 0.5) * BIN_M, 0, BIN_M, count)
        graph.add(bar.fill(MEASURED).color("none"))
    return svg(graph, HEIGHT, "sonars")


def gaps(streams: Streams) -> str:
    """Draw the time between two velocities over the recording."""
    times = _times(streams)
    late = [
        (at, (b.mono_ns - a.mono_ns) / NS_PER_S)
        for at, (a, b) in zip(times[1:], pairwise(streams.velocities), strict=True)
    ]
    xs, ys = downsampled([at for at, _ in late], [gap for _, gap in late])
    graph = _graph("time, s", f"between two velocities, s ({keys.VELOCITY.rate_hz} Hz)")
    graph.add(zp.PolyLine(xs, ys).color(MEASURED).strokewidth(1))
    return svg(graph, HEIGHT, "gaps")


def distances(streams: Streams) -> str:
    """Draw the counted distance, and the velocities integrated over time."""
    graph = _graph("time, s", "distance, m")
    begin_ns, first = streams.velocities[0].mono_ns, streams.mileages[0].distance
    steps = [a.linear * (b.mono_ns - a.mono_ns) / NS_PER_S for a, b in pairwise(streams.velocities)]
    xs, ys = downsampled(_times(streams), [0.0, *accumulate(steps)])
    graph.add(zp.PolyLine(xs, ys).name("velocities, integrated").color(MEASURED).strokewidth(1.2))
    times = [(m.mono_ns - begin_ns) / NS_PER_S for m in streams.mileages]
    xs, ys = downsampled(times, [m.distance - first for m in streams.mileages])
    graph.add(zp.PolyLine(xs, ys).name("counted").color(STOPPED).strokewidth(1.2).stroke("--"))
    graph.legend("right")
    return svg(graph, HEIGHT, "distances")


def check(streams: Streams, course: Course) -> str:
    """Draw the measured speed, and that of the model under the same commands."""
    graph = _graph("time, s", "speed, m/s")
    begin_ns = streams.velocities[0].mono_ns
    xs, ys = downsampled(_times(streams), [v.linear for v in streams.velocities])
    graph.add(zp.PolyLine(xs, ys).name("measured").color(MEASURED).strokewidth(1.2))
    times = [(at_ns - begin_ns) / NS_PER_S for at_ns in course.times]
    xs, ys = downsampled(times, [twist.linear for twist in course.twists])
    graph.add(zp.PolyLine(xs, ys).name("model").color(REQUESTED).strokewidth(1).stroke("--"))
    graph.legend("right")
    return svg(graph, HEIGHT, "check")


def _graph(x_name: str, y_name: str) -> zp.Graph:
    graph = zp.Graph()
    graph.axesnames(x_name, y_name)
    return graph


def _times(streams: Streams) -> list[float]:
    """Return the times of the velocities, s since the first one."""
    begin_ns = streams.velocities[0].mono_ns
    return [(v.mono_ns - begin_ns) / NS_PER_S for v in streams.velocities]
