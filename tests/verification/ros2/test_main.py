"""The selection of checks, and what a missing cargo causes."""

import contextlib
from pathlib import Path

import pytest

from verification.ros2 import __main__ as program
from verification.ros2 import build
from verification.ros2.__main__ import chosen, main, run
from verification.ros2.fixture import Robot
from verification.ros2.independent import SETTINGS


def test_every_check_has_a_name_of_its_own() -> None:
    names = [(group, name) for group, name, _ in chosen(None)]
    assert len(set(names)) == len(names) > 20


def test_selection_by_text() -> None:
    assert {group for group, _, _ in chosen("zenoh")} == {"zenoh"}
    assert [name for _, name, _ in chosen("1.7.2")] == ["1.7.2"]


def test_settings_belong_to_a_check() -> None:
    assert set(SETTINGS) <= {name for _, name, _ in chosen("hiroz")}


def test_without_cargo_it_is_skipped(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(build, "has_cargo", lambda: False)
    assert main([]) == 0
    assert capsys.readouterr().out.startswith("skipped: cargo")


def test_a_failed_check_is_a_row_and_the_next_one_runs(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def fails(_: Robot) -> str:
        raise AssertionError("moved 0.50 m")

    monkeypatch.setattr(program, "robot_with_gateway", lambda *_: contextlib.nullcontext())
    checks = [("held_back", "fails", fails), ("held_back", "passes", lambda _: "no motion")]
    first, second = run(tmp_path, Path("peer"), checks)
    assert (first[2], first[3]) == ("AssertionError: moved 0.50 m", "FAILED")
    assert second[2].startswith("no motion")
    assert second[3] == "ok"
