"""``t2 config``: values, sources, and invalid settings."""

from pathlib import Path

import pytest

from cli.__main__ import main
from common.cli_args import EXIT_CONFIG


def shown(capsys: pytest.CaptureFixture[str], *words: str) -> list[list[str]]:
    assert main(["config", *words]) == 0
    return [line.split(maxsplit=2) for line in capsys.readouterr().out.splitlines()]


def test_settings_with_their_sources(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("T2__HOST__REALTIME", raising=False)
    assert shown(capsys, "--changed") == []
    files = [tmp_path / name for name in ("a.toml", "b.toml", "c.toml")]
    for number, file in enumerate(files):
        file.write_text(f"[board]\nport = {5000 + number}\n[safety]\nmargin = 0.2\n")
    monkeypatch.setenv("T2_CONFIG", f"{files[0]}:{files[1]}:")
    rows = shown(capsys, "--set", "robot.id=007")
    assert ["bus.listen", '["tcp/127.0.0.1:7447"]', "default"] in rows
    assert ["safety.sources.demo.priority", "15", "default"] in rows
    assert ["robot.id", '"007"', "--set robot.id=007"] in rows
    port = ["board.port", "5001", str(files[1])]
    assert port in rows
    assert shown(capsys, "--changed") == [port]
    assert shown(capsys, "--changed", "safety") == []
    last = ["--config", str(files[2]), "--set", "board.listen_ports=4002,4001"]
    assert shown(capsys, "--changed", *last) == [["board.port", "5002", str(files[2])]]
    paths = [path for path, *_ in shown(capsys, "vehicle.max")]
    assert paths == ["vehicle.max_linear", "vehicle.max_angular"]


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["nothing"], "no setting begins with 'nothing'"),
        (["--set", "bord.port=1"], "no section 'bord'; did you mean 'board'?"),
    ],
)
def test_what_does_not_exist_is_named(
    words: list[str], problem: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["config", *words]) == EXIT_CONFIG
    out, err = capsys.readouterr()
    assert (out, err.startswith("t2 config: "), problem in err) == ("", True, True)
