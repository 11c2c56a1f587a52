"""The folder of patrol: what a person edits, and what a power loss or a full disk leaves."""

import json
import os
from pathlib import Path
from typing import Any

import pytest

from services.patrol.core.course import OpenRound
from services.patrol.core.teaching import OpenTeaching
from services.patrol.store import Store
from t2 import messages as m
from t2.messages import Phrase
from tests.patrol.core.vehicle_fixture import LOOP, route


def record(number: int = 1, **fields: Any) -> m.Round:
    return m.Round(id=f"2026-{number:05}", route="yard", robot="001", start_ns=number, **fields)


def open_round(number: int = 1) -> OpenRound:
    return OpenRound(round=record(number), along=1.0, stop=0, homeward=False, turned=False)


def reason(found: m.Route | Phrase) -> str:
    assert isinstance(found, Phrase)
    return str(found.fields.get("reason", found.name))


def test_a_route_is_written_for_people(tmp_path: Path) -> None:
    store, made = Store(tmp_path), route(LOOP, stay=2.5, name="北门")
    store.save_route(made)
    text = (tmp_path / "routes/北门.json").read_text(encoding="utf-8")
    assert len(text.splitlines()) == 9 + len(made.points)
    assert '  {"x": 4.0, "y": 0.0, "station": "gate", "stay": 2.5},' in text.splitlines()
    assert json.loads(text)["points"][2] == {"x": 4.0, "y": 3.0}
    assert store.route("北门") == made
    assert [each.name for each in tmp_path.glob("routes/*")] == ["北门.json"]


@pytest.mark.parametrize(
    ("before", "after", "reason_of"),
    [
        ('"speed"', '"sped"', "Object contains unknown field `sped`"),
        ('"x": 4.0', '"x": "4.0"', "Expected `float`, got `str` - at `$.points[1].x`"),
        ('"speed": 0.5', '"speed": 5', "Expected `float` <= 1.5 - at `$.speed`"),
        ('"blocked": "wait"', '"blocked": "go"', "Invalid enum value 'go' - at `$.blocked`"),
        (" ]\n}", " ]", "Input data was truncated"),
        ('"name": "yard"', '"name": "other"', "route.name"),
        ('"station": "home", ', "", "route.no_home"),
        ('"x": 4.0', '"x": 400', "route.gap"),
        ("gate", "home", "route.station_twice"),
    ],
)
def test_a_typing_error_is_named(tmp_path: Path, before: str, after: str, reason_of: str) -> None:
    store = Store(tmp_path)
    store.save_route(route(stay=1.0))
    file = tmp_path / "routes/yard.json"
    text = file.read_text(encoding="utf-8")
    assert before in text
    file.write_text(text.replace(before, after, 1), encoding="utf-8")
    found = reason(store.route("yard"))
    assert found == reason_of
    (summary,) = store.routes()
    assert summary.problem


def test_a_file_that_was_cut_is_a_problem_of_one_route(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.save_route(route(name="whole"))
    store.save_route(route(name="cut"))
    file = tmp_path / "routes/cut.json"
    file.write_bytes(file.read_bytes()[:60])
    (tmp_path / "routes/empty.json").touch()
    assert [(each.name, bool(each.problem)) for each in store.routes()] == [
        ("cut", True), ("empty", True), ("whole", False),
    ]  # fmt: skip


def test_what_is_no_file_of_a_route_is_not_listed(tmp_path: Path) -> None:
    store, folder = Store(tmp_path), tmp_path / "routes"
    store.save_route(route())
    (folder / ".#yard.json").symlink_to("operator@host.1")  # as an editor does
    (folder / ".json").touch()
    (folder / "folder.json").mkdir()
    os.mkfifo(folder / "pipe.json")
    Path(os.fsdecode(os.fsencode(folder) + b"/stra\xdfe.json")).touch()
    assert [each.name for each in store.routes()] == ["yard"]
    assert reason(store.route("pipe")) == "route.none"


def test_an_edited_file_is_read_again(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.save_route(route())
    assert store.routes()[0].length == pytest.approx(4.0)
    store.save_route(route(((0.0, 0.0, "home"), (7.25, 0.0))))
    assert store.routes()[0].length == pytest.approx(7.25)
    store.delete_route("yard")
    assert store.routes() == []
    assert reason(store.route("yard")) == "route.none"


def test_the_ledger_survives_a_line_that_was_cut(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.end(record(1), route(), [])
    store.end(record(2), route(), [])
    ledger = tmp_path / "rounds.jsonl"
    ledger.write_bytes(ledger.read_bytes()[:-30])
    again = Store(tmp_path)
    assert [each.id for each in again.rounds(10)] == ["2026-00001"]
    again.end(record(3), route(), [])
    assert [each.id for each in again.rounds(10)] == ["2026-00003", "2026-00001"]


def test_the_ledger_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.patrol.store.LEDGER", 4000)
    monkeypatch.setattr("services.patrol.store.TRACKS", 3)
    store = Store(tmp_path)
    for number in range(1, 31):
        store.end(record(number), route(), [])
    assert (tmp_path / "rounds.jsonl").stat().st_size <= 4000
    assert 5 <= len(store.rounds(1000)) < 30
    assert store.rounds(1)[0].id == "2026-00030"
    assert len([*tmp_path.glob("rounds/*.json")]) == 3


def test_a_long_ledger_is_listed_from_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(tmp_path)
    for number in range(1, 6):
        store.end(record(number), route(), [])
    size = (tmp_path / "rounds.jsonl").stat().st_size
    monkeypatch.setattr("services.patrol.store.TAIL", size // 2)
    assert [each.id for each in store.rounds(1000)] == ["2026-00005", "2026-00004"]
    found = store.round("2026-00001")
    assert found is not None


def test_a_round_waits_for_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(tmp_path)
    store.begin(open_round(), route())
    monkeypatch.setattr(Store, "_append", full)
    with pytest.raises(OSError, match="No space"):
        store.end(record(), route(), [])
    assert Store(tmp_path).read_open()  # a restart finds it
    assert [each.id for each in store.rounds(10)] == ["2026-00001"]
    monkeypatch.undo()
    store.write_waiting()
    assert Store(tmp_path).read_open() is None
    assert [each.id for each in Store(tmp_path).rounds(10)] == ["2026-00001"]


def full(*_: object) -> None:
    raise OSError(28, "No space left on device")


def test_an_open_round_is_found_again_with_its_route(tmp_path: Path) -> None:
    Store(tmp_path).begin(open_round(), route(LOOP))
    assert Store(tmp_path).read_open() == (open_round(), route(LOOP))


def test_an_open_round_that_is_in_the_ledger_is_over(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.begin(open_round(), route())
    saved = (tmp_path / "round.json").read_bytes()
    store.end(record(), route(), [])
    (tmp_path / "round.json").write_bytes(saved)  # the power failed before it was removed
    assert Store(tmp_path).read_open() is None


@pytest.mark.parametrize("content", [b"", b"{", b"\xff", b'{"round": 1}'])
def test_an_open_round_that_cannot_be_read_is_an_error(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "round.json").write_bytes(content)
    with pytest.raises(OSError, match="cannot be read"):
        Store(tmp_path).read_open()


def test_each_round_has_an_id_of_its_own(tmp_path: Path) -> None:
    store = Store(tmp_path)
    first = store.new_id("20260101-000000", "yard")
    store.begin(OpenRound(round=m.Round(id=first, route="yard", robot="001", start_ns=0),
                          along=0.0, stop=0, homeward=False, turned=False), route())  # fmt: skip
    assert (first, store.new_id("20260101-000000", "yard")) == (
        "20260101-000000-yard", "20260101-000000-yard-2",
    )  # fmt: skip


@pytest.mark.parametrize("round_id", ["../routes/yard", "a\0b", "none", "../../etc/passwd"])
def test_an_id_is_no_path(tmp_path: Path, round_id: str) -> None:
    store = Store(tmp_path)
    store.save_route(route())
    assert store.tracked(round_id) is None
    assert store.round(round_id) is None


def test_track_and_route_of_a_round_are_kept(tmp_path: Path) -> None:
    store = Store(tmp_path)
    track = [m.TrackPoint(x=1.0, y=2.0, deviation=0.1, sigma=0.05)]
    store.end(record(), route(), track)
    tracked = Store(tmp_path).tracked("2026-00001")
    assert tracked
    assert (tracked.route, [*tracked.track]) == (route(), track)


def test_what_is_being_taught_is_kept(tmp_path: Path) -> None:
    store = Store(tmp_path)
    of = OpenTeaching("yard", route().points)
    store.write_teaching(of)
    assert Store(tmp_path).read_teaching() == of
    store.write_teaching(None)
    assert Store(tmp_path).read_teaching() is None
