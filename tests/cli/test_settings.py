"""``t2 config``: values, sources, and invalid settings."""

from pathlib import Path

import pytest

from cli.__main__ import main
from common.cli_args import EXIT_CONFIG


def test_every_setting_has_its_value_and_source(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("[board]\nport = 5001\n[safety]\nmargin = 0.3\n", encoding="utf-8")
    words = ["--config", str(file), "--set", "robot.id=007"]
    assert main(["config", *words]) == 0
    rows = [line.split(maxsplit=2) for line in capsys.readouterr().out.splitlines()]
    assert {path.split(".")[0] for path, _, _ in rows} == {
        "unsafe_overrides", "robot", "host", "bus", "board", "wire", "log", "vehicle", "safety",
        "odom", "teleop", "dashboard", "recorder", "metrics", "ros2", "sim",
    }  # fmt: skip
    assert ["bus.listen", '["tcp/127.0.0.1:7447"]', "default"] in rows
    assert ["safety.sources.demo.priority", "15", "default"] in rows
    assert ["board.port", "5001", str(file)] in rows
    assert ["robot.id", '"007"', "--set robot.id=007"] in rows


def shown(capsys: pytest.CaptureFixture[str], *words: str) -> list[list[str]]:
    assert main(["config", *words]) == 0
    return [line.split(maxsplit=2) for line in capsys.readouterr().out.splitlines()]


def test_some_of_the_settings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("T2__HOST__REALTIME", raising=False)
    assert shown(capsys, "--changed") == []
    files = [tmp_path / name for name in ("a.toml", "b.toml", "c.toml")]
    for number, file in enumerate(files):
        file.write_text(f"[board]\nport = {5000 + number}\n[safety]\nmargin = 0.2\n")
    monkeypatch.setenv("T2_CONFIG", f"{files[0]}:{files[1]}:")
    port = ["board.port", "5001", str(files[1])]
    assert shown(capsys, "--changed") == [port]
    assert shown(capsys, "--changed", "safety") == []
    last = ["--config", str(files[2]), "--set", "board.listen_ports=4002,4001"]
    assert shown(capsys, "--changed", *last) == [["board.port", "5002", str(files[2])]]
    paths = [path for path, *_ in shown(capsys, "vehicle.max")]
    assert paths == ["vehicle.max_linear", "vehicle.max_angular"]
    assert main(["config", "nothing"]) == EXIT_CONFIG
    assert "no setting begins with 'nothing'" in capsys.readouterr().err


def test_an_invalid_setting_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["config", "--set", "bord.port=1"]) == EXIT_CONFIG
    shown = capsys.readouterr()
    assert shown.out == ""
    assert "t2 config: " in shown.err
    assert "no section 'bord'; did you mean 'board'?" in shown.err
