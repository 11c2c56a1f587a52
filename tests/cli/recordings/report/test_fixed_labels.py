"""Labels of a figure that do not scroll."""

import re
from xml.etree import ElementTree as ET

from cli.recordings.report import figures
from cli.recordings.report.fixed_labels import chart
from cli.recordings.report.timeline import Timeline
from tests.cli.recordings.report.drive_fixture import drive


def test_the_labels_at_the_left_are_repeated_at_the_same_place() -> None:
    timeline = Timeline()
    for arrival in drive():
        timeline.add(*arrival)
    figure = figures.speeds(timeline)
    whole = ET.fromstring(chart(figure))
    labels = {text.text for text in whole[0].iter("{http://www.w3.org/2000/svg}text")}
    assert {"verdict", "safety", "linear, m/s"} <= labels
    assert "measured" not in labels  # the legend is at the right
    (width,) = re.findall(r"width: ([\d.]+)%", chart(figure))
    *_, column, height = whole[0][0].attrib["viewBox"].split()
    assert abs(float(width) / 100 - float(column) / figures.WIDTH) < 1e-4
    assert height == "700"


def test_a_figure_without_labels_is_unchanged() -> None:
    assert chart("<svg></svg>") == '<div class="chart"><svg></svg></div>'
