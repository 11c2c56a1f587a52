"""The dashboard's settings, and errors at its start."""

import socket
from pathlib import Path

import pytest

from common.bus.session import check_files
from common.cli_args import EXIT_CONFIG, EXIT_LINK
from common.errors import ConfigError
from common.settings import BusSettings
from services.dashboard import __main__ as dashboard
from services.dashboard import host
from services.dashboard.config import Dashboard


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--host", "robot"], "host is 'robot'"),
        (["--set", "vehicle.gears_linear=0.5,0.4,0.3,0.2,0.1"], "should be 5 rising speeds"),
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
    file.write_bytes(b"\xef\xbb\xbflong enough \r\n")
    assert host.token(Dashboard(token_file=str(file))) == "long enough"
    for content in (b"long enough\nsecond line", b"long\xe2\x80\x8benough", b"long\xffenough"):
        file.write_bytes(content)
        with pytest.raises(ConfigError, match=r"token: .*(write one line|save the file as UTF-8)"):
            host.token(Dashboard(token_file=str(file)))
    file.write_text("short", encoding="utf-8")
    with pytest.raises(ConfigError, match="5 characters"):
        host.token(Dashboard(token_file=str(file)))


def test_an_encrypted_private_key_is_refused_without_a_question(tmp_path: Path) -> None:
    plain, key = str(tmp_path / "a.pem"), str(tmp_path / "key.pem")
    Path(plain).write_text("-----BEGIN CERTIFICATE-----\n", encoding="ascii")
    Path(key).write_text("-----BEGIN ENCRYPTED PRIVATE KEY-----\n", encoding="ascii")
    with pytest.raises(ConfigError, match=r"^dashboard\.private_key .*: is encrypted.*openssl"):
        host.check_certificate(Dashboard(certificate=plain, private_key=key))
    bus = BusSettings(connect=("tls/robot:7447",), ca=plain, certificate=plain, private_key=key)
    with pytest.raises(ConfigError, match=r"^bus\.private_key: .*: is encrypted.*openssl"):
        check_files(bus, bus.endpoints)
