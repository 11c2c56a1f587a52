"""The sonar view in characters."""

import pytest
from rich.text import Text

from common.messages import Bumper, RangeStatus, Ultrasonic
from services.teleop.sonar_view import BANDS, DIM, FAULT, around, reading

OK: tuple[RangeStatus, ...] = ("ok",) * 8


def style_at(text: Text, words: str) -> str:
    start = text.plain.index(words)
    return next(str(span.style) for span in text.spans if span.start <= start < span.end)


@pytest.mark.parametrize(
    ("distance", "status", "words", "style", "lit"),
    [
        (0.30, "ok", "0.30 m", BANDS[0][1], {0}),
        (0.5, "ok", "0.50 m", BANDS[1][1], {1}),
        (1.99, "ok", "1.99 m", BANDS[2][1], {2}),
        (2.0, "ok", "2.00 m", "green", set()),
        (None, "fault", "fault", FAULT, {0, 1, 2}),
        (None, "too_near", "near", BANDS[0][1], {0, 1, 2}),
        (None, "no_echo", "-", DIM, set()),
        (None, "ok", "-", DIM, set()),
    ],
)
def test_a_reading_has_a_label_a_colour_and_arcs(
    distance: float | None, status: RangeStatus, words: str, style: str, lit: set[int]
) -> None:
    seen = reading(distance, status)
    assert (seen.label, seen.style, set(seen.lit)) == (words, style, lit)


def test_every_sonar_is_drawn_at_its_place() -> None:
    ranges = tuple(1.0 + i / 10 for i in range(8))
    lines = around(Ultrasonic(ranges=ranges, status=OK), None, 34, 11).plain.split("\n")
    assert "1.20 m" in lines[0]  # front
    assert lines[1].index("1.10 m") < lines[1].index("1.30 m")  # front left, front right
    assert lines[5].index("1.00 m") < lines[5].index("T2") < lines[5].index("1.40 m")
    assert lines[9].index("1.70 m") < lines[9].index("1.50 m")  # rear left, rear right
    assert "1.60 m" in lines[10]  # rear


@pytest.mark.parametrize(("width", "height"), [(34, 11), (38, 11), (60, 13), (120, 40), (4, 1)])
def test_the_view_has_the_requested_size(width: int, height: int) -> None:
    lines = around(None, None, width, height).plain.split("\n")
    assert len(lines) == height
    assert {len(line) for line in lines} == {width}


def test_more_room_gives_more_arcs() -> None:
    seen = Ultrasonic(ranges=(None,) * 8, status=("fault",) * 8)
    small, large = (around(seen, None, 60, height).plain.count("╱") for height in (9, 13))
    assert (small, large) == (2, 6)


def test_a_near_wall_lights_the_nearest_arc_only() -> None:
    nothing: RangeStatus = "no_echo"
    seen = Ultrasonic(
        ranges=(None, None, 0.3, *(None,) * 5), status=(nothing, nothing, "ok", *(nothing,) * 5)
    )
    text = around(seen, None, 34, 11)
    assert style_at(text, "━" * 7 + " ") == DIM  # the outer one, drawn first
    lines = text.plain.split("\n")
    inner = sum(len(line) + 1 for line in lines[:2]) + lines[2].index("━")
    assert [str(s.style) for s in text.spans if s.start <= inner < s.end] == [BANDS[0][1]]


def test_without_data_every_range_is_unknown() -> None:
    assert around(None, None).plain.count("?") == 8


@pytest.mark.parametrize(
    ("bumper", "words"), [(Bumper(pressed=True), "BUMPER"), (Bumper(pressed=False), "T2")]
)
def test_the_body_shows_the_bumper(bumper: Bumper, words: str) -> None:
    assert words in around(None, bumper).plain
