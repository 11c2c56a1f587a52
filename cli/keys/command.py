"""``t2 keys``: the certificate authority of a site; its certificates grant access to the bus.

``init`` creates the authority, ``issue`` and ``renew`` create certificates, ``revoke`` revokes them
and ``list`` shows them. Guide: docs/keys.md; rights of each role: docs/security.md.
"""

import argparse
import sys
import time
from collections.abc import Iterable
from datetime import UTC, datetime
from getpass import getpass
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from cli.keys import instructions, member_list
from cli.keys.member_list import BOUND, CA_DAYS, DAY_S, DAYS, EARLY_S
from cli.keys.members import OPERATORS_SOURCES, ROLES, Members, Profile
from common.cli_args import file_path, needs_extra
from common.errors import ConfigError
from t2.errors import T2Error

if TYPE_CHECKING:
    from cli.keys.store import Folder

FOLDER = Path("keys")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the five subcommands."""
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    init = _verb(verbs, "init", "create the CA of a site")
    issue = _verb(verbs, "issue", "create a certificate, and the folder for its machine")
    renew = _verb(verbs, "renew", "create the next certificate; the previous one stays valid")
    revoke = _verb(verbs, "revoke", "revoke the certificates of a member")
    _verb(verbs, "list", "list every certificate, and what expires soon")
    init.add_argument("--site", default="t2", metavar="NAME", help="t2 by default")
    init.add_argument(
        "--passphrase", action="store_true", help="ask for a passphrase, to encrypt the CA's key"
    )
    for verb in (issue, renew, revoke):
        verb.add_argument("role", choices=ROLES, metavar="ROLE", help=", ".join(ROLES))
        verb.add_argument(
            "name", metavar="NAME", help="a robot's id, or the name of a person or site"
        )
    issue.add_argument(
        "--robot", action="append", default=[], metavar="ID",
        help="for a driver, device or ros: allow this robot, '*' every one; may be repeated",
    )  # fmt: skip
    issue.add_argument(
        "--source", action="append", default=[], metavar="NAME",
        help="for a driver or device: allow only this source, as in safety.sources, "
        "safety.limits or localization.sources; may be repeated; by default "
        f"{', '.join(OPERATORS_SOURCES)} for a driver, which may also reset; NAME for a device",
    )  # fmt: skip
    for verb in (issue, renew):
        _add_signing(verb)
    revoke.add_argument("--serial", help="only the certificate whose name ends with this serial")


def run(options: argparse.Namespace) -> int:
    """Run the operation: read the folder, call the pure modules, write, print."""
    with needs_extra("keys", "it"):
        from cli.keys import store
    if options.verb == "list":
        show(store.Folder(options.folder))
        return 0
    passphrase = b""
    if options.verb == "init":
        member_list.profile("viewer", options.site)  # checks the name
        passphrase = new_passphrase() if options.passphrase else b""
    with store.locked(options.folder, create=options.verb == "init") as folder:
        if options.verb == "init":
            init(folder, options, passphrase)
        else:
            {"issue": issue, "renew": renew, "revoke": revoke}[options.verb](folder, options)
    return 0


def init(folder: "Folder", options: argparse.Namespace, passphrase: bytes) -> None:
    """Create an authority."""
    from cli.keys.ca import CertificateAuthority

    now_s = time.time()
    span = now_s - EARLY_S, now_s + CA_DAYS * DAY_S
    authority = CertificateAuthority.create(options.site, span)
    folder.create_authority(authority, Members(site=options.site), passphrase)
    until = f"{authority.certificate.not_valid_after_utc:%Y-%m-%d}"
    _print(instructions.authority_created(str(options.folder), options.site, until))


def issue(folder: "Folder", options: argparse.Namespace) -> None:
    """Create the first certificate of a member."""
    sources = options.source or member_list.default_sources(options.role, options.name)
    wanted = member_list.profile(
        options.role, options.name, options.robot, options.address, sources
    )
    member_list.check_free(folder.read(), wanted.role, wanted.name, time.time())
    _create_certificate(folder, wanted, options, settings=True)


def renew(folder: "Folder", options: argparse.Namespace) -> None:
    """Create another certificate with the same rights."""
    old = member_list.newest(folder.read(), options.role, options.name)
    robots = old.robots if old.role in BOUND else ()
    addresses = options.address or old.addresses
    sources = old.sources or member_list.default_sources(old.role, old.name)
    wanted = member_list.profile(old.role, old.name, robots, addresses, sources)
    _create_certificate(folder, wanted, options, settings=False)
    _print(instructions.certificate_renewed(old))


def revoke(folder: "Folder", options: argparse.Namespace) -> None:
    """Revoke the certificates of a member."""
    left, revoked = member_list.revoked(folder.read(), options.role, options.name, options.serial)
    folder.write(left)
    target = folder.path / f"{options.role}.{options.name}"
    _print(instructions.certificates_revoked(revoked, str(target), member_list.routers(left)))


def show(folder: "Folder") -> None:
    """List every certificate."""
    members, ends_s = folder.read(), folder.ends_s()
    print(f"site {members.site}, CA until {datetime.fromtimestamp(ends_s, UTC):%Y-%m-%d}\n")
    print(member_list.as_table(members, time.time()))


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
        raise T2Error("the CA's key needs its passphrase: run it in a terminal")
    return getpass(prompt).encode()


def _create_certificate(
    folder: "Folder", wanted: Profile, options: argparse.Namespace, *, settings: bool
) -> None:
    authority = folder.authority(lambda: _ask("passphrase of the CA's key: "))
    span = member_list.span(time.time(), options.days, folder.ends_s())
    issued = authority.issue(wanted, span)
    before = folder.read()
    members = replace(before, members=(*before.members, issued.member))
    target = folder.write_machine(issued, members, settings=settings)
    folder.write(members)
    routers = member_list.routers(members)
    _print(instructions.certificate_issued(issued.member, str(target), routers))


def _print(lines: Iterable[str]) -> None:
    print(*lines, sep="\n")


def _verb(
    verbs: "argparse._SubParsersAction[argparse.ArgumentParser]", name: str, text: str
) -> argparse.ArgumentParser:
    parser = verbs.add_parser(name, help=text, description=text)
    parser.add_argument(
        "--folder", type=file_path, default=FOLDER, help="folder of the CA; keys by default"
    )
    return parser


def _add_signing(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--address", action="append", default=[], metavar="HOST",
        help="for a router: its IP address or host name; may be repeated; a robot has the manual's "
        "addresses by default; localhost is always included",
    )  # fmt: skip
    parser.add_argument(
        "--days", type=int, default=DAYS, help=f"validity in days; {DAYS} by default"
    )
