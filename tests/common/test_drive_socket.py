"""Path of the drive link's socket, and that no other user can connect."""

import os
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from common import drive_socket
from common.cli_args import EXIT_CONFIG
from common.drive_socket import prepare, socket_path
from common.errors import ConfigError
from common.settings import BusSettings


def test_both_ends_derive_one_path_and_two_stacks_or_networks_two(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("TMPDIR", "/elsewhere")
    listening = BusSettings(listen=("tcp/127.0.0.1:7448",))
    dialling = BusSettings(connect=("tcp/127.0.0.1:7448",))
    assert socket_path(listening, "001") == socket_path(dialling, "001")
    robots = [(BusSettings(), "001"), (BusSettings(), "002"), (dialling, "001")]
    paths = {socket_path(*robot) for robot in robots}
    for network in (tmp_path, tmp_path / "missing"):
        monkeypatch.setattr(drive_socket, "NETWORK", network)
        paths.add(socket_path(*robots[0]))
    assert len(paths) == 5
    assert {path.parent for path in paths} == {Path(f"/elsewhere/t2-{os.getuid()}")}
    given = BusSettings(drive="unixsock-stream//run/t2-drive/drive.sock")
    assert socket_path(given, "001") == Path("/run/t2-drive/drive.sock")


def test_bridge_and_safety_need_one_router() -> None:
    one, other = "tcp/127.0.0.1:7447", "tcp/127.0.0.1:7448"
    for where in (BusSettings(listen=(one, other)), BusSettings(connect=(one, one))):
        drive_socket.check_router(where)
    with pytest.raises(ConfigError, match="bridge and safety need one router, not 2"):
        drive_socket.check_router(BusSettings(connect=(one, other)))


@pytest.mark.parametrize("name", ["bridge", "safety"])
def test_neither_starts_with_two_routers(name: str) -> None:
    words = ["--set", 'bus.connect=["tcp/127.0.0.1:7447", "tcp/127.0.0.1:7448"]']
    command = [sys.executable, "-m", f"services.{name}", *words]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == EXIT_CONFIG
    assert "bus.connect: bridge and safety need one router" in ended.stderr


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
    monkeypatch.setenv("TMPDIR", "/elsewhere")
    with pytest.raises(ConfigError, match=r"bus\.drive: .* at most 107 bytes.*name a shorter one"):
        socket_path(BusSettings(), "x" * 100)


def test_its_directory_is_made_for_this_user_alone(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "t2" / "drive.sock"
    prepare(path)
    assert path.parent.stat().st_mode & 0o777 == 0o700
    with socket.socket(socket.AF_UNIX) as left:  # by a bridge that was killed
        left.bind(str(path))
    prepare(path)


NEEDS_ROOT = pytest.mark.skipif(os.getuid() != 0, reason="only root can give a directory away")


@pytest.mark.parametrize(
    ("given", "refusal"),
    [
        (lambda folder: folder.chmod(0o710), "{folder} must .* it has mode 710"),
        pytest.param(lambda folder: os.chown(folder, 1234, -1), "owner 1234", marks=NEEDS_ROOT),
        (lambda folder: folder.symlink_to(folder.rename(f"{folder}2")), "must be a directory"),
        (lambda folder: (folder / "drive.sock").write_text("important"),
         "{folder}/drive.sock exists and is not a socket"),
        (lambda folder: (folder / "drive.sock").symlink_to("elsewhere"), "is not a socket"),
    ],
)  # fmt: skip
def test_what_others_can_enter_or_is_not_ours_is_refused_and_stays(
    tmp_path: Path, given: Callable[[Path], object], refusal: str
) -> None:
    folder = tmp_path / "t2"
    folder.mkdir(mode=0o700)
    given(folder)
    before = list(folder.iterdir())
    with pytest.raises(ConfigError, match=rf"bus\.drive: .*{refusal.format(folder=folder)}"):
        prepare(folder / "drive.sock")
    assert list(folder.iterdir()) == before
