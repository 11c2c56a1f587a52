"""The operations of ``t2 keys``: read the folder, call the pure modules, write, print."""

import argparse
import sys
import time
from collections.abc import Callable, Iterable
from datetime import UTC, datetime
from getpass import getpass

from msgspec.structs import replace

from cli.keys import instructions, member_list
from cli.keys.ca import CertificateAuthority, certificate_from
from cli.keys.member_list import BOUND, CA_DAYS, DAY_S, EARLY_S, EVERY_ROBOT
from cli.keys.store import Folder, locked
from common.errors import ConfigError, RobotError
from common.members import Members, Profile


def init(options: argparse.Namespace) -> int:
    """Create an authority."""
    site = member_list.profile("viewer", options.site).name  # checks the name
    passphrase = new_passphrase() if options.passphrase else b""
    now_s = time.time()
    authority = CertificateAuthority.create(site, (now_s - EARLY_S, now_s + CA_DAYS * DAY_S))
    with locked(options.folder, create=True) as folder:
        folder.create_authority(authority, Members(site=site), passphrase)
    until = f"{authority.certificate.not_valid_after_utc:%Y-%m-%d}"
    _print(instructions.authority_created(str(options.folder), site, until))
    return 0


def issue(options: argparse.Namespace) -> int:
    """Create the first certificate of a member."""
    robots = (*options.robot, *([EVERY_ROBOT] if options.every else []))
    sources = options.source or member_list.default_sources(options.role, options.name)
    wanted = member_list.profile(options.role, options.name, robots, options.address, sources)
    with locked(options.folder) as folder:
        member_list.check_free(folder.read(), wanted.role, wanted.name, time.time())
        _create_certificate(folder, wanted, options, settings=True)
    return 0


def renew(options: argparse.Namespace) -> int:
    """Create another certificate with the same rights."""
    with locked(options.folder) as folder:
        old = member_list.newest(folder.read(), options.role, options.name)
        robots = old.robots if old.role in BOUND else ()
        addresses = options.address or old.addresses
        sources = old.sources or member_list.default_sources(old.role, old.name)
        wanted = member_list.profile(old.role, old.name, robots, addresses, sources)
        _create_certificate(folder, wanted, options, settings=False)
    _print(instructions.certificate_renewed(old))
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
    print(f"site {members.site}, CA until {datetime.fromtimestamp(ends_s, UTC):%Y-%m-%d}\n")
    print(member_list.as_table(members, now_s))
    return 0


def new_passphrase() -> bytes:
    """Ask for the passphrase of a new key, twice."""
    first = _ask("passphrase for the CA's key: ")
    if not first:
        raise ConfigError("--passphrase: an empty passphrase does not protect the key")
    if _ask("repeat the passphrase: ") != first:
        raise ConfigError("--passphrase: the two passphrases differ; nothing was created")
    return first


def _ask(prompt: str) -> bytes:
    if not sys.stdin.isatty():
        raise RobotError("the CA's key needs its passphrase: run it in a terminal")
    return getpass(prompt).encode()


def _create_certificate(
    folder: Folder, wanted: Profile, options: argparse.Namespace, *, settings: bool
) -> None:
    authority = folder.authority(options.ca_key, lambda: _ask("passphrase of the CA's key: "))
    ends_s = authority.certificate.not_valid_after_utc.timestamp()
    issued = authority.issue(wanted, member_list.span(time.time(), options.days, ends_s))
    before = folder.read()
    members = replace(before, members=(*before.members, issued.member))
    target = folder.write_machine(issued, members, settings=settings)
    folder.write(members)
    routers = member_list.routers(members)
    _print(instructions.certificate_issued(issued.member, str(target), routers))


def _print(lines: Iterable[str]) -> None:
    for line in lines:
        print(line)


OPERATIONS: dict[str, Callable[[argparse.Namespace], int]] = {
    "init": init, "issue": issue, "renew": renew, "revoke": revoke, "list": show,
}  # fmt: skip
