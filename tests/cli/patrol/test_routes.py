"""``t2 routes``: the list, a route as a file, teaching, and errors of a file."""

from pathlib import Path

import msgspec
import pytest

from t2 import messages as m
from tests.cli.inspect.tool import Tool
from tests.cli.patrol.fake_patrol import YARD, FakePatrol
from tests.common.bus_fixture import BusFixture


def test_the_list_is_aligned_and_has_the_problems(buses: BusFixture, tool: Tool) -> None:
    """A Chinese character takes two columns."""
    patrol = FakePatrol(buses)
    result = tool("routes", "list", text=True)
    assert result.out == (
        "route    m  stations    problem\n"
        "院子   5.0  大门, gate  -\n"
        "hall     -  -           hall.json: broken.\n"
    )
    found = tool("routes", "list").lines
    assert msgspec.convert(found, tuple[m.RouteSummary, ...]) == patrol.routes


def test_no_routes(buses: BusFixture, tool: Tool) -> None:
    patrol = FakePatrol(buses)
    patrol.routes = ()
    result = tool("routes", "list", text=True)
    assert (result.code, result.out) == (0, "")
    assert "`t2 routes teach NAME --station HOME`" in result.err


def test_a_shown_route_can_be_saved(buses: BusFixture, tool: Tool, tmp_path: Path) -> None:
    patrol = FakePatrol(buses)
    file = tmp_path / "yard.json"
    file.write_text(tool("routes", "show", "院子").out, encoding="utf-8")
    result = tool("routes", "save", str(file), text=True)
    assert (result.code, result.out, result.err) == (0, "Done.\n", "")
    (request,) = patrol.asked
    assert (request.action, request.points) == ("save", YARD)


@pytest.mark.parametrize(
    ("words", "sent"),
    [
        (("teach", "院子", "--station", "大门"),
         m.TeachRequest(action="begin", route="院子", station="大门")),
        (("teach", "a-1", "--station", "gate 2", "--stay", "5"),
         m.TeachRequest(action="begin", route="a-1", station="gate 2", stay=5.0)),
        (("station", "lift", "--stay", "0.5"),
         m.TeachRequest(action="station", station="lift", stay=0.5)),
        (("end",), m.TeachRequest(action="end")),
        (("cancel",), m.TeachRequest(action="cancel")),
        (("delete", "hall"), m.TeachRequest(action="delete", route="hall")),
    ],
)  # fmt: skip
def test_requests_have_a_fresh_echo(
    words: tuple[str, ...], sent: m.TeachRequest, buses: BusFixture, tool: Tool
) -> None:
    patrol = FakePatrol(buses)
    assert tool("routes", *words).code == 0
    (asked,) = patrol.asked
    assert asked == msgspec.structs.replace(sent, echo=asked.echo)
    assert asked.echo is not None
    assert patrol.safety is not None
    assert 100 < asked.echo <= patrol.safety.heartbeat


FILE = """{
 "name": "yard",
 "robot": "001",
 "points": [{"x": 0, "y": 0, "station": "home"}, {"x": 3, "y": 0}]
}"""


@pytest.mark.parametrize(
    ("given", "changed", "named"),
    [
        ('"robot"', '"robt"', ("`robt`", "docs/bus.md#route")),
        ('"x": 3', '"x": "3"', ("Expected `float`", "$.points[1].x")),
        ('"robot": "001",', '"robot": "001", "corridor": 0.1,', ("`$.corridor`", ">= 0.2")),
        ('"001",', '"001"', ("malformed", "(line 4)")),
        ('"station": "home"', '"station": ""', ("The first point needs a station: home.",)),
        ('"x": 3', '"x": 300', ("Points 1 and 2 are 300 m apart",)),
    ],
)
def test_a_wrong_file_is_refused_before_anything_is_sent(
    given: str, changed: str, named: tuple[str, ...], tool: Tool, tmp_path: Path
) -> None:
    """There is no patrol, and no safety."""
    file = tmp_path / "yard.json"
    assert given in FILE
    file.write_text(FILE.replace(given, changed), encoding="utf-8")
    result = tool("routes", "save", str(file))
    assert (result.code, result.out) == (1, "")
    for word in (str(file), *named):
        assert word in result.err


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (("show", "nix"), 1, "t2 routes: refused: There is no route nix."),
        (("show", "a b"), 2, "'a b' is no name of a route"),
        (("station", "-"), 2, "'-' is no name of a station"),
        (("station", "lift", "--stay", "nan"), 1, "$.stay"),
        (("save", "nix.json"), 1, "nix.json: cannot be read: No such file"),
    ],
)
def test_errors(
    words: tuple[str, ...], code: int, sentence: str, buses: BusFixture, tool: Tool
) -> None:
    patrol = FakePatrol(buses)
    result = tool("routes", *words)
    assert (result.code, result.out) == (code, "")
    assert sentence in result.err
    assert not patrol.asked
