"""The authority's folder: ``ca.pem``, ``ca.key``, ``members.json``, and a folder for each machine.

Every file appears whole or not at all, and only its owner can read what is secret. Who changes the
list holds a lock meanwhile, so that of two commands at once neither loses the other's member.
"""

import contextlib
import fcntl
import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec

from cli.keys import member_list
from cli.keys.ca import (
    Authority,
    Issued,
    certificate_pem,
    key_pem,
)
from cli.keys.machine_settings import CA, CERTIFICATE, MEMBERS, PRIVATE_KEY, SETTINGS, bus_toml
from cli.keys.profile import Profile
from common import members as lists
from common.errors import RobotError
from common.members import Members

SECRET, PUBLIC = 0o600, 0o644


class Folder:
    """Reads and writes what is in it; raises ``RobotError`` that names the file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.ca = path / CA
        self.ca_key = path / "ca.key"
        self.members = path / MEMBERS

    def found(self, authority: Authority, members: Members, passphrase: bytes) -> None:
        """Write a new authority; refuse to touch one that is there."""
        for file in (self.ca, self.ca_key, self.members):
            if file.exists():
                raise RobotError(
                    f"{file} is there already: another CA would lock everybody out; "
                    "`--folder NEW` makes one beside it"
                )
        _write(self.ca_key, key_pem(authority.key, passphrase), SECRET)
        _write(self.members, _as_file(members), PUBLIC)
        _write(self.ca, certificate_pem(authority.certificate), PUBLIC)

    def authority(self, key_file: Path | None, passphrase: Callable[[], bytes]) -> Authority:
        """Return what signs; its key may lie elsewhere."""
        key = key_file or self.ca_key
        if not key.exists():
            raise RobotError(
                f"{key} is not there, and only it can sign; "
                "if it is kept elsewhere, name it with --ca-key FILE"
            )
        return Authority.load(self.certificate(), _read(key), passphrase)

    def certificate(self) -> bytes:
        """Return the authority's own certificate."""
        if not self.ca.exists():
            raise RobotError(f"{self.path} has no CA; `t2 keys init` makes one")
        return _read(self.ca)

    def read(self) -> Members:
        """Return the list."""
        self.certificate()  # so that who has no CA is told so
        return lists.read(self.members)

    def write(self, members: Members) -> None:
        """Write the list, here and into each folder of a router that is let in."""
        _write(self.members, _as_file(members), PUBLIC)
        for router in member_list.routers(members):
            if (self.path / router.who / CERTIFICATE).exists():
                _write(self.path / router.who / MEMBERS, _as_file(members), PUBLIC)

    def hand_out(
        self, profile: Profile, issued: Issued, members: Members, *, settings: bool
    ) -> Path:
        """Write the folder that goes to a machine and return it; ``settings``: ``bus.toml`` too."""
        target = self.path / profile.who
        others = [
            each
            for each in member_list.routers(members)
            if each.addresses and each.who != profile.who
        ]
        with _told(target):
            target.mkdir(mode=0o700, exist_ok=True)
        _write(target / PRIVATE_KEY, issued.private_key, SECRET)
        _write(target / CERTIFICATE, issued.certificate, PUBLIC)
        _write(target / CA, self.certificate(), PUBLIC)
        if settings or not (target / SETTINGS).exists():
            _write(target / SETTINGS, bus_toml(profile, others).encode(), PUBLIC)
        return target


@contextlib.contextmanager
def locked(path: Path, *, create: bool = False) -> Iterator[Folder]:
    """Keep other commands out of a folder meanwhile."""
    with _told(path):
        if create:
            path.mkdir(mode=0o700, parents=True, exist_ok=True)
        elif not path.is_dir():
            raise RobotError(f"{path} has no CA; `t2 keys init` makes one")
        descriptor = os.open(path, os.O_RDONLY)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            yield Folder(path)
        finally:
            os.close(descriptor)


def _as_file(members: Members) -> bytes:
    return msgspec.json.format(msgspec.json.encode(members), indent=2) + b"\n"


def _read(file: Path) -> bytes:
    with _told(file):
        return file.read_bytes()


def _write(file: Path, content: bytes, mode: int) -> None:
    """Let a file appear at once: a reader finds the old one or the new one, and a crash no half."""
    with _told(file):
        descriptor, made = tempfile.mkstemp(prefix=".", dir=file.parent)
        try:
            with os.fdopen(descriptor, "wb") as stream:
                stream.write(content)
                stream.flush()
                os.fchmod(descriptor, mode)
                os.fsync(descriptor)
            Path(made).rename(file)
        except BaseException:  # ctrl-c, too: it may be a private key, in a folder that is copied
            Path(made).unlink(missing_ok=True)
            raise


@contextlib.contextmanager
def _told(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise RobotError(f"{error.filename or path}: {error.strerror}") from None
