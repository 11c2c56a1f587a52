"""The authority's folder: file modes, atomic writes and locking."""

import fcntl
import os
import stat
from pathlib import Path
from unittest.mock import Mock

import pytest

from cli.keys.ca import CertificateAuthority
from cli.keys.member_list import DAY_S, profile
from cli.keys.members import Members, Profile
from cli.keys.store import Folder, locked
from t2.errors import T2Error
from tests.cli.keys.site_fixture import member, members

SPAN = 1.8e9, 1.8e9 + 10 * DAY_S
ROBOT = profile("robot", "001")
DRIVER = profile("driver", "anna", ("001",))


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    with locked(tmp_path / "keys", create=True) as made:
        made.create_authority(
            CertificateAuthority.create("berlin", SPAN), Members(site="berlin"), b""
        )
    return made


def create_machine(folder: Folder, who: Profile, *, settings: bool = True) -> Path:
    issued = folder.authority(bytes).issue(who, SPAN)
    listed = Members(site="berlin", members=(*folder.read().members, issued.member))
    target = folder.write_machine(issued, listed, settings=settings)
    folder.write(listed)
    return target


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_only_the_owner_can_read_secrets_whatever_the_umask(folder: Folder) -> None:
    before = os.umask(0)
    try:
        target = create_machine(folder, ROBOT)
    finally:
        os.umask(before)
    assert (mode(folder.path), mode(target)) == (0o700, 0o700)
    assert mode(folder.ca_key) == mode(target / "private.key") == 0o600
    public = {"ca.pem", "certificate.pem", "bus.toml", "members.json"}
    assert {file.name for file in target.iterdir()} == {*public, "private.key"}
    assert {mode(target / name) for name in public} == {0o644}


def test_only_admitted_routers_get_the_list(folder: Folder) -> None:
    robot, driver = create_machine(folder, ROBOT), create_machine(folder, DRIVER)
    assert (robot / "members.json").read_bytes() == folder.members.read_bytes()
    assert not (driver / "members.json").exists()
    folder.write(members(member("robot", "001", revoked=True)))
    assert (robot / "members.json").read_bytes() != folder.members.read_bytes()


def test_renewal_keeps_edited_settings(folder: Folder) -> None:
    target = create_machine(folder, DRIVER)
    (target / "bus.toml").write_text("# mine\n", encoding="utf-8")
    create_machine(folder, DRIVER, settings=False)
    assert (target / "bus.toml").read_text(encoding="utf-8") == "# mine\n"
    create_machine(folder, DRIVER, settings=True)
    assert "connect" in (target / "bus.toml").read_text(encoding="utf-8")
    (target / "bus.toml").unlink()
    create_machine(folder, DRIVER, settings=False)
    assert (target / "bus.toml").exists()


def test_an_authority_is_never_overwritten(folder: Folder) -> None:
    kept = folder.ca_key.read_bytes()
    folder.ca.unlink()
    with pytest.raises(T2Error, match="exists: another CA would invalidate"):
        folder.create_authority(CertificateAuthority.create("x", SPAN), Members(site="x"), b"")
    assert folder.ca_key.read_bytes() == kept


@pytest.mark.parametrize("trouble", [OSError(28, "No space left"), KeyboardInterrupt()])
def test_a_full_disk_or_ctrl_c_keeps_the_old_list(
    trouble: BaseException, folder: Folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    create_machine(folder, ROBOT)
    kept = folder.members.read_bytes()
    monkeypatch.setattr("cli.keys.store.os.fsync", Mock(side_effect=trouble))
    with pytest.raises((T2Error, KeyboardInterrupt)):
        folder.write(Members(site="berlin"))
    assert folder.members.read_bytes() == kept
    assert not [file for file in folder.path.iterdir() if file.name.startswith(".")]


def test_a_command_locks_the_folder(folder: Folder) -> None:
    descriptor = os.open(folder.path, os.O_RDONLY)
    with locked(folder.path), pytest.raises(BlockingIOError):
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    os.close(descriptor)
