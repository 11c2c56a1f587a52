"""The page of a fit: the table, and a figure of what each estimate was made from."""

from collections.abc import Iterator, Sequence

from cli.fit.check import Course
from cli.fit.fit import Fit, of_command
from cli.fit.stops import DRIVING, TURNING
from cli.fit.streams import Streams
from cli.page import fill_page

TITLES = {"stop": "STOP", "brake": "BRAKE"}

Figure = tuple[str, str]  # a title, and SVG


def page(
    found: Fit,
    *,
    title: str,
    not_safe: str,
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    lines: Sequence[str],
    checked: tuple[Streams, Course] | None,
) -> str:
    """Return the page; ``checked`` is the recording that the model has followed."""
    return fill_page(
        "fit/fit.html",
        {},
        title=title,
        not_safe=not_safe,
        head=head,
        rows=rows,
        lines=lines,
        figures=list(_figures(found, checked)),
    )


def _figures(found: Fit, checked: tuple[Streams, Course] | None) -> Iterator[Figure]:
    from cli.fit import figures  # of the extra

    for axis in (DRIVING, TURNING):
        for direction in axis.directions.values():
            for kind, title in TITLES.items():
                if mine := of_command(found.stops, kind, direction):
                    yield f"{title} {direction}", figures.stops(mine, f"{kind}-{direction}")
    if checked is not None and checked[1].times:
        yield "The model under the recorded commands", figures.check(*checked)
    if found.ranges:
        yield "Sonars", figures.sonars(found.streams)
    for streams in (each for each in found.streams if len(each.velocities) > 1):
        yield "Counted and integrated distance", figures.distances(streams)
        yield "Gaps of the velocity", figures.gaps(streams)
