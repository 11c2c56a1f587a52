"""``t2 config``: values, sources, and invalid settings."""

import json
from pathlib import Path

import pytest

from cli.__main__ import main
from common.cli_args import EXIT_CONFIG


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text("[board]\nport = 5001\n[safety]\nmargin = 0.3\n", encoding="utf-8")
    return path


def as_json(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, dict[str, object]]:
    assert main(["config", "--json", *words]) == 0
    table: dict[str, dict[str, object]] = json.loads(capsys.readouterr().out)
    return table


def test_every_section_has_its_source(capsys: pytest.CaptureFixture[str]) -> None:
    table = as_json(capsys)
    sections = {path.split(".")[0] for path in table}
    assert sections == {
        "robot", "bus", "board", "wire", "log", "vehicle",
        "bridge", "safety", "odom", "teleop", "dashboard", "recorder", "metrics", "ros2", "sim",
    }  # fmt: skip
    assert table["bus.listen"]["value"] == ["tcp/127.0.0.1:7447"]
    assert table["bus.listen"]["origin"] == "default"
    assert table["safety.sources.demo.priority"]["value"] == 15


def test_the_table_has_a_line_per_setting(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--config", str(file), "--set", "robot.id=007"]
    paths = list(as_json(capsys, *words))
    assert main(["config", *words]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == paths
    assert len({line.index('"007"') for line in lines if line.startswith("robot.id ")}) == 1
    (port,) = (line for line in lines if line.startswith("board.port "))
    assert port.split() == ["board.port", "5001", str(file)]
    (robot,) = (line for line in lines if line.startswith("robot.id "))
    assert robot.endswith("--set robot.id=007")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--set", "board.port=0"], "board.port = 0"),
        (["--set", "board.prot=1"], "did you mean 'port'?"),
        (["--set", "bord.port=1"], "no section 'bord'; did you mean 'board'?"),
        (["--set", "board.port"], "should look like board.port=4002"),
        (["--config", "no/such.toml"], "no/such.toml: cannot be read"),
    ],
)
def test_invalid_settings_are_named(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["config", *words]) == EXIT_CONFIG
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("t2 config: ")
    assert message in shown.err
