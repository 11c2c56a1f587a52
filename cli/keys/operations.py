"""The operations of ``t2 keys``: read the folder, call the pure modules, write, print."""

import argparse
import sys
import time
from collections.abc import Callable, Iterable
from datetime import UTC, datetime
from getpass import getpass
from pathlib import Path

from cli.inspect import output
from cli.keys import instructions, member_list
from cli.keys.ca import CertificateAuthority, certificate_from
from cli.keys.profile import (
    BOUND,
    CA_DAYS,
    DAY_S,
    EARLY_S,
    EVERY_ROBOT,
    Profile,
    Span,
    default_sources,
    profile,
    span,
)
from cli.keys.store import Folder, locked
from common.errors import ConfigError, RobotError
from common.members import Members


def init(options: argparse.Namespace) -> int:
    """Create an authority."""
    site = profile("viewer", options.site, (), ()).name  # checks the name
    passphrase = new_passphrase(options.passphrase_file, options.passphrase)
    now_s = time.time()
    authority = CertificateAuthority.create(site, Span(now_s - EARLY_S, now_s + CA_DAYS * DAY_S))
    with locked(options.folder, create=True) as folder:
        folder.create_authority(authority, Members(site=site), passphrase)
    until = f"{authority.certificate.not_valid_after_utc:%Y-%m-%d}"
    _print(instructions.authority_created(str(options.folder), site, until, bool(passphrase)))
    return 0


def issue(options: argparse.Namespace) -> int:
    """Create the first certificate of a member."""
    robots = (*options.robot, *([EVERY_ROBOT] if options.every else []))
    sources = options.source or default_sources(options.role, options.name)
    wanted = profile(options.role, options.name, robots, options.address, sources)
    with locked(options.folder) as folder:
        member_list.check_free(folder.read(), wanted.role, wanted.name, time.time())
        _create_certificate(folder, wanted, options, settings=True)
    return 0


def renew(options: argparse.Namespace) -> int:
    """Create another certificate with the same rights."""
    with locked(options.folder) as folder:
        old = member_list.newest(folder.read(), options.role, options.name)
        robots = old.robots if old.role in BOUND else ()
        addresses = options.address or member_list.addresses_of(old)
        wanted = profile(old.role, old.name, robots, addresses, old.sources)
        _create_certificate(folder, wanted, options, settings=False)
    _print(instructions.certificate_renewed(old.role, old.name, old))
    return 0


def revoke(options: argparse.Namespace) -> int:
    """Revoke the certificates of a member."""
    with locked(options.folder) as folder:
        left, revoked = member_list.revoked(
            folder.read(), options.role, options.name, options.serial
        )
        folder.write(left)
        target = folder.path / f"{options.role}.{options.name}"
        _print(instructions.certificates_revoked(revoked, str(target), member_list.routers(left)))
    return 0


def show(options: argparse.Namespace) -> int:
    """List every certificate."""
    folder = Folder(options.folder)
    members, now_s = folder.read(), time.time()
    ends_s = certificate_from(folder.certificate()).not_valid_after_utc.timestamp()
    if options.json:
        output.line(member_list.as_json(members, ends_s, now_s))
        return 0
    until = f"{datetime.fromtimestamp(ends_s, UTC):%Y-%m-%d}"
    print(f"site {members.site}, CA until {until}\n")
    print(member_list.as_table(members, now_s))
    for line in member_list.advice(members, ends_s, now_s):
        print(f"\n{line}")
    return 0


def new_passphrase(file: Path | None, wanted: bool) -> bytes:
    """Return the passphrase for a new key; empty if none is wanted."""
    if file:
        return _from_file(file)
    if not wanted:
        return b""
    first = _ask("passphrase for the CA's key: ")
    if not first:
        raise ConfigError("--passphrase: an empty passphrase does not protect the key")
    if _ask("repeat the passphrase: ") != first:
        raise ConfigError("--passphrase: the two passphrases differ; nothing was created")
    return first


def known_passphrase(file: Path | None) -> bytes:
    """Return the passphrase of an encrypted key."""
    return _from_file(file) if file else _ask("passphrase of the CA's key: ")


def _from_file(file: Path) -> bytes:
    try:
        passphrase = file.read_bytes().rstrip(b"\r\n")
    except OSError as error:
        raise ConfigError(f"--passphrase-file {file}: cannot be read: {error.strerror}") from None
    if not passphrase:
        raise ConfigError(f"--passphrase-file {file}: is empty")
    return passphrase


def _ask(prompt: str) -> bytes:
    if not sys.stdin.isatty():
        raise RobotError("the CA's key needs its passphrase: use --passphrase-file FILE")
    return getpass(prompt).encode()


def _create_certificate(
    folder: Folder, wanted: Profile, options: argparse.Namespace, *, settings: bool
) -> None:
    authority = folder.authority(options.ca_key, lambda: known_passphrase(options.passphrase_file))
    ends_s = authority.certificate.not_valid_after_utc.timestamp()
    issued = authority.issue(wanted, span(time.time(), options.days, ends_s))
    members = member_list.added(folder.read(), issued.member)
    target = folder.write_machine(wanted, issued, members, settings=settings)
    folder.write(members)
    routers = member_list.routers(members)
    _print(instructions.certificate_issued(wanted, issued.member, str(target), routers))


def _print(lines: Iterable[str]) -> None:
    for line in lines:
        print(line)


OPERATIONS: dict[str, Callable[[argparse.Namespace], int]] = {
    "init": init, "issue": issue, "renew": renew, "revoke": revoke, "list": show,
}  # fmt: skip
