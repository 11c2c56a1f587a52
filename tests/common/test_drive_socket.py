"""Path of the drive link's socket, and that no other user can connect."""

import os
import socket
from pathlib import Path

import pytest

from common import drive_socket
from common.drive_socket import prepare, socket_path
from common.errors import ConfigError
from common.settings import BusSettings


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "t2"
    made.mkdir(mode=0o700)
    return made


def derived(robot: str = "001", *connect: str, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TMPDIR", "/elsewhere")
    return socket_path(BusSettings(connect=connect), robot)


def test_both_ends_derive_one_path_and_two_stacks_two(monkeypatch: pytest.MonkeyPatch) -> None:
    listening = BusSettings(listen=("tcp/127.0.0.1:7448",))
    dialling = BusSettings(connect=("tcp/127.0.0.1:7448",))
    assert socket_path(listening, "001") == socket_path(dialling, "001")
    paths = {
        derived("001", monkeypatch=monkeypatch),
        derived("002", monkeypatch=monkeypatch),
        derived("001", "tcp/127.0.0.1:7448", monkeypatch=monkeypatch),
    }
    assert len(paths) == 3
    assert {path.parent for path in paths} == {Path(f"/elsewhere/t2-{os.getuid()}")}


def test_another_network_is_another_robot(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    here = socket_path(BusSettings(), "001")
    monkeypatch.setattr(drive_socket, "NETWORK", tmp_path)
    there = socket_path(BusSettings(), "001")
    monkeypatch.setattr(drive_socket, "NETWORK", tmp_path / "missing")
    assert len({here, there, socket_path(BusSettings(), "001")}) == 3


def test_the_setting_is_stronger() -> None:
    where = BusSettings(drive="unixsock-stream//run/t2-drive/drive.sock")
    assert socket_path(where, "001") == Path("/run/t2-drive/drive.sock")


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp/127.0.0.1:7447",
        "unixsock-stream/run/relative.sock",
        "unixsock-stream//run/t2.sock?rel=1",
        "unixsock-stream//run/t2.sock#iface=lo",
        "/run/t2.sock",
    ],
)
def test_only_a_socket_with_an_absolute_path_will_do(endpoint: str) -> None:
    with pytest.raises(ValueError, match="should look like unixsock-stream//run"):
        BusSettings(drive=endpoint)


def test_a_path_has_107_bytes_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    fits = "/run/" + "x" * 102
    assert socket_path(BusSettings(drive=f"unixsock-stream/{fits}"), "001") == Path(fits)
    with pytest.raises(ValueError, match=r"at most 107 bytes, .* has 108"):
        BusSettings(drive=f"unixsock-stream/{fits}x")
    with pytest.raises(ValueError, match="has 109"):
        BusSettings(drive="unixsock-stream//run/" + "x" * 100 + "ää")
    with pytest.raises(ConfigError, match=r"bus\.drive: .* at most 107 bytes.*name a shorter one"):
        derived("x" * 100, monkeypatch=monkeypatch)


def test_its_directory_is_made_for_this_user_alone(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "t2" / "drive.sock"
    prepare(path)
    assert path.parent.stat().st_mode & 0o777 == 0o700
    prepare(path)  # again, as a second process does


@pytest.mark.parametrize("mode", [0o755, 0o770, 0o701])
def test_a_directory_that_others_can_enter_is_refused(folder: Path, mode: int) -> None:
    folder.chmod(mode)
    with pytest.raises(ConfigError, match=rf"bus\.drive: {folder} must .* it has mode {mode:o}"):
        prepare(folder / "drive.sock")


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a directory away")
def test_a_directory_of_somebody_else_is_refused(folder: Path) -> None:
    os.chown(folder, 1234, -1)
    with pytest.raises(ConfigError, match="owner 1234"):
        prepare(folder / "drive.sock")


def test_a_link_to_a_directory_is_refused(folder: Path, tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(folder)
    with pytest.raises(ConfigError, match="must be a directory"):
        prepare(link / "drive.sock")


def test_a_foreign_file_is_named_and_stays(folder: Path) -> None:
    path = folder / "drive.sock"
    path.write_text("important")
    with pytest.raises(ConfigError, match=rf"bus\.drive: {path} exists and is not a socket"):
        prepare(path)
    assert path.read_text() == "important"
    path.unlink()
    path.symlink_to(folder / "elsewhere")
    with pytest.raises(ConfigError, match="is not a socket"):
        prepare(path)


def test_a_socket_that_a_killed_bridge_left_is_no_error(folder: Path) -> None:
    path = folder / "drive.sock"
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(str(path))
    prepare(path)
