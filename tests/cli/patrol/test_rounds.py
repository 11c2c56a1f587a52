"""``t2 rounds``: actions, status, the list and the report."""

import re
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from cli.patrol import rounds
from t2 import messages as m
from t2.messages import Phrase
from tests.cli.inspect.tool import Tool
from tests.cli.patrol.fake_patrol import ROUND, STATE, FakePatrol
from tests.common.bus_fixture import BusFixture


def test_start_prints_the_answer_in_the_readers_language(
    buses: BusFixture, tool: Tool, monkeypatch: pytest.MonkeyPatch
) -> None:
    patrol = FakePatrol(buses)
    monkeypatch.setenv("T2_LANG", "zh")
    result = tool("rounds", "start", "院子", text=True)
    assert (result.code, result.out, result.err) == (0, "完成。\n", "")
    (asked,) = patrol.asked
    assert (asked.action, asked.route) == ("start", "院子")
    assert asked.echo > 100


@pytest.mark.parametrize("verb", ["depart", "resume", "return"])
def test_what_moves_the_vehicle_needs_safety(verb: str, buses: BusFixture, tool: Tool) -> None:
    patrol = FakePatrol(buses, safety=False)
    result = tool("rounds", verb)
    assert result.code == 1
    assert "no state of safety" in result.err
    assert not patrol.asked


def test_what_stops_it_does_not(buses: BusFixture, tool: Tool) -> None:
    patrol = FakePatrol(buses, safety=False)
    assert tool("rounds", "pause", text=True).out == "Done.\n"
    refused = tool("rounds", "abort")
    assert (refused.code, refused.out) == (1, "")
    assert refused.err == "t2 rounds: refused: No route is being taught.\n"
    assert [each.action for each in patrol.asked] == ["pause", "abort"]


def test_status(buses: BusFixture, tool: Tool) -> None:
    FakePatrol(buses)
    lines = tool("rounds", "status", text=True).out.splitlines()
    assert lines[:6] == [
        "state: driving",
        "text: Driving 院子; the next station is gate.",
        "round: 1",
        "progress: 1.0 m of 5.0 m",
        "next station: gate",
        "deviation: 0.10 m and 2 sigma 0.10 m are 0.20 m; the corridor is 0.50 m",
    ]
    assert re.fullmatch(r"next round: night on 院子, 2023-11-1\d \d\d:\d\d:\d\d", lines[6])
    (found,) = tool("rounds", "status").lines
    assert msgspec.convert(found, m.PatrolState).progress == STATE.progress


@pytest.mark.parametrize("state", ["staying", "done"])
def test_no_station_is_next_during_a_stay_nor_after_a_round(
    state: m.RoundState, buses: BusFixture, tool: Tool
) -> None:
    FakePatrol(buses).state = replace(STATE, state=state)
    out = tool("rounds", "status", text=True).out
    assert "\nnext station:" not in out
    assert ("\nprogress:" in out) == (state == "staying")


def test_status_of_a_route_that_is_taught(buses: BusFixture, tool: Tool) -> None:
    stopped = (Phrase("teach.lost"),)
    taught = m.Teaching(route="a", length=2.0, points=3, stations=("home",), phrases=stopped)
    FakePatrol(buses).state = m.PatrolState(state="idle", text="Idle.", teaching=taught)
    result = tool("rounds", "status", text=True)
    text = "a, 2.0 m, stations: home. The position in the map is not known."
    assert result.out == f"state: idle\ntext: Idle.\nteaching: {text}\n"


def test_status_without_patrol(tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rounds, "STATE_S", 0.1)
    result = tool("rounds", "status")
    assert (result.code, result.out) == (1, "")
    assert "no state of patrol within 0.1 s: is patrol running? run `t2 doctor" in result.err


def test_the_list(buses: BusFixture, tool: Tool) -> None:
    patrol = FakePatrol(buses)
    head, line = tool("rounds", "list", "--most", "3", text=True).out.splitlines()
    assert patrol.asked[-1].most == 3
    assert head.split()[:4] == ["round", "begin", "time", "result"]
    # Also a round of the future, or of a clock that was set backward.
    assert line.split()[0] == "20261128-夜"
    assert line.split()[3:] == ["1:05", "home", "5.0", "1", "1", "0.10", "0.30", "-"]
    assert msgspec.convert(tool("rounds", "list").lines[0], m.Round) == ROUND
    patrol.rounds = (replace(ROUND, start_ns=2**63 - 1, end_ns=-(2**63)),)
    assert "0:00" in tool("rounds", "list", text=True).out


def test_report(
    buses: BusFixture, tool: Tool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By default of the newest round, under its id."""
    FakePatrol(buses)
    monkeypatch.chdir(tmp_path)
    result = tool("rounds", "report", text=True)
    assert (result.code, result.out) == (0, "20261128-夜.html\n")
    text = (tmp_path / "20261128-夜.html").read_text(encoding="utf-8")
    for word in (
        "The round is complete.", "大门", "gate", "0.50 m to either side", "1:05 min",
        "deviation + 2 sigma", "&lt;b&gt;Waiting", "1.00, 0.10",
    ):  # fmt: skip
        assert word in text, word
    assert not re.findall(r"<script|<b>|(?:src|href|action|data|poster)=[^#]{2}", text)
    assert text.count("<svg") == 2


def test_a_report_of_a_round_that_did_not_move_or_whose_track_is_gone(
    buses: BusFixture, tool: Tool, tmp_path: Path
) -> None:
    patrol = FakePatrol(buses)
    out = tmp_path / "a.html"
    for track, route, figures in (((), patrol.route, 1), ((), None, 0)):
        patrol.track, patrol.route = track, route
        assert tool("rounds", "report", ROUND.id, "-o", str(out)).code == 0
        assert out.read_text(encoding="utf-8").count("<svg") == figures


def test_the_name_of_a_report_stays_in_the_folder(
    buses: BusFixture, tool: Tool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    patrol = FakePatrol(buses)
    patrol.rounds = (replace(ROUND, id="../../a"),)
    monkeypatch.chdir(tmp_path)
    assert tool("rounds", "report", text=True).out == "______a.html\n"


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (("report", "nix"), 1, "t2 rounds: refused: There is no round nix in the ledger."),
        (("report", "-o", "/nix/a.html"), 1, "/nix/a.html: cannot be written: No such file"),
        (("list", "--most", "0"), 1, ">= 1 - at `$.most`; nothing was sent"),
        (("start", "../a"), 2, "'../a' is no name of a route"),
        (("start",), 2, "the following arguments are required: ROUTE"),
    ],
)
def test_errors(
    words: tuple[str, ...], code: int, sentence: str, buses: BusFixture, tool: Tool
) -> None:
    FakePatrol(buses)
    result = tool("rounds", *words)
    assert (result.code, result.out) == (code, "")
    assert sentence in result.err
