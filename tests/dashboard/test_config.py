"""The dashboard's settings, and errors at its start."""

import socket
from pathlib import Path

import pytest

from common.cli_args import EXIT_CONFIG, EXIT_LINK
from common.errors import ConfigError
from services.dashboard import __main__ as dashboard
from services.dashboard import host
from services.dashboard.config import Dashboard


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--host", "robot"], "host is 'robot'"),
        (["--set", "dashboard.gears_linear=0.5,0.4,0.3,0.2,0.1"], "should be 5 rising speeds"),
        (["--set", "dashboard.certificate=a.pem"], "must be set together"),
        (["--set", "dashboard.token_file=/no/such"], "/no/such"),
        (
            ["--set", "dashboard.certificate=/no/c", "--set", "dashboard.private_key=/no/k"],
            "/no/c",
        ),
    ],
)
def test_an_invalid_setting_ends_the_start(
    words: list[str], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert dashboard.main(words) == EXIT_CONFIG
    assert named in capsys.readouterr().err


def test_a_port_in_use_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        assert dashboard.main(["--port", port]) == EXIT_LINK
    said = capsys.readouterr().err
    assert port in said
    assert "set another one" in said


def test_the_token_of_a_file(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_text("long enough\n", encoding="utf-8")
    assert host.token(Dashboard(token_file=str(file))) == "long enough"
    file.write_text("short", encoding="utf-8")
    with pytest.raises(ConfigError, match="5 characters"):
        host.token(Dashboard(token_file=str(file)))
