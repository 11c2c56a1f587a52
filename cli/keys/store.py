"""The authority's folder: ``ca.pem``, ``ca.key``, ``members.json``, and a folder for each machine.

Files are replaced atomically, and only their owner can read secrets. A command that changes the
member list locks the folder, so that concurrent commands do not lose each other's members.
"""

import contextlib
import fcntl
import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec

from cli.keys import member_list
from cli.keys import members as member_files
from cli.keys.ca import CertificateAuthority, Issued, certificate_from, certificate_pem, key_pem
from cli.keys.machine_settings import CA, CERTIFICATE, MEMBERS, PRIVATE_KEY, SETTINGS, bus_toml
from cli.keys.members import Members
from t2.errors import T2Error

SECRET, PUBLIC = 0o600, 0o644


class Folder:
    """Reads and writes the files; raises ``T2Error`` with the name of the file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.ca = path / CA
        self.ca_key = path / "ca.key"
        self.members = path / MEMBERS

    def create_authority(
        self, authority: CertificateAuthority, members: Members, passphrase: bytes
    ) -> None:
        """Write a new authority; raise ``T2Error`` if there is one already."""
        for file in (self.ca, self.ca_key, self.members):
            if file.exists():
                raise T2Error(
                    f"{file} exists: another CA would invalidate all certificates; "
                    "`--folder NEW` creates one in another folder"
                )
        _write(self.ca_key, key_pem(authority.key, passphrase), SECRET)
        _write(self.members, _as_file(members), PUBLIC)
        _write(self.ca, certificate_pem(authority.certificate), PUBLIC)

    def authority(self, passphrase: Callable[[], bytes]) -> CertificateAuthority:
        """Return the authority."""
        if not self.ca_key.exists():
            raise T2Error(
                f"{self.ca_key} not found: it is needed to sign; "
                "if it is stored elsewhere, make it a link"
            )
        return CertificateAuthority.load(self.certificate(), _read(self.ca_key), passphrase)

    def certificate(self) -> bytes:
        """Return the certificate of the authority."""
        if not self.ca.exists():
            raise T2Error(f"{self.path} has no CA; `t2 keys init` creates one")
        return _read(self.ca)

    def ends_s(self) -> float:
        """Return the end of the authority's certificate, in seconds since 1970."""
        return certificate_from(self.certificate()).not_valid_after_utc.timestamp()

    def read(self) -> Members:
        """Return the member list."""
        self.certificate()  # a missing CA has its own error message
        return member_files.read(self.members)

    def write(self, members: Members) -> None:
        """Write the member list, also to the folder of each admitted router."""
        _write(self.members, _as_file(members), PUBLIC)
        for router in member_list.routers(members):
            if (self.path / router.label / CERTIFICATE).exists():
                _write(self.path / router.label / MEMBERS, _as_file(members), PUBLIC)

    def write_machine(self, issued: Issued, members: Members, *, settings: bool) -> Path:
        """Write the folder for a machine and return it; with ``settings``, also ``bus.toml``."""
        target = self.path / issued.member.label
        routers = member_list.routers(members)
        others = [each for each in routers if each.label != issued.member.label]
        with _os_errors(target):
            target.mkdir(mode=0o700, exist_ok=True)
        _write(target / PRIVATE_KEY, issued.private_key, SECRET)
        _write(target / CERTIFICATE, issued.certificate, PUBLIC)
        _write(target / CA, self.certificate(), PUBLIC)
        if settings or not (target / SETTINGS).exists():
            _write(target / SETTINGS, bus_toml(issued.member, others).encode(), PUBLIC)
        return target


@contextlib.contextmanager
def locked(path: Path, *, create: bool = False) -> Iterator[Folder]:
    """Lock a folder against other commands while the context lasts."""
    with _os_errors(path):
        if create:
            path.mkdir(mode=0o700, parents=True, exist_ok=True)
        elif not path.is_dir():
            raise T2Error(f"{path} has no CA; `t2 keys init` creates one")
        descriptor = os.open(path, os.O_RDONLY)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            yield Folder(path)
        finally:
            os.close(descriptor)


def _as_file(members: Members) -> bytes:
    return msgspec.json.format(msgspec.json.encode(members), indent=2) + b"\n"


def _read(file: Path) -> bytes:
    with _os_errors(file):
        return file.read_bytes()


def _write(file: Path, content: bytes, mode: int) -> None:
    """Replace a file atomically: readers see the old or the new content, also after a crash."""
    with _os_errors(file):
        descriptor, temporary = tempfile.mkstemp(prefix=".", dir=file.parent)
        try:
            with os.fdopen(descriptor, "wb") as stream:
                stream.write(content)
                stream.flush()
                os.fchmod(descriptor, mode)
                os.fsync(descriptor)
            Path(temporary).rename(file)
        except BaseException:  # also on Ctrl-C: it may be a private key, in a folder that is copied
            Path(temporary).unlink(missing_ok=True)
            raise


@contextlib.contextmanager
def _os_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise T2Error(f"{error.filename or path}: {error.strerror}") from None
