"""What ``t2 keys`` does, verb by verb: reads, lets the cores decide, writes, and says so."""

import argparse
import time
from collections.abc import Callable, Iterable
from datetime import UTC, datetime

from cli.inspect import output
from cli.keys import instructions, member_list, passphrase, report
from cli.keys.ca import Authority, certificate_from
from cli.keys.profile import (
    CA_DAYS,
    DAY_S,
    EARLY_S,
    EVERY_ROBOT,
    OPERATORS_SOURCES,
    Profile,
    Span,
    profile,
    span,
)
from cli.keys.store import Folder, locked
from common.members import Members


def init(options: argparse.Namespace) -> int:
    """Make an authority."""
    site = profile("viewer", options.site, (), ()).name  # a site is named like anybody
    protection = passphrase.new(options.passphrase_file, options.passphrase)
    now_s = time.time()
    authority = Authority.found(site, Span(now_s - EARLY_S, now_s + CA_DAYS * DAY_S))
    with locked(options.folder, create=True) as folder:
        folder.found(authority, Members(site=site), protection)
    until = f"{authority.certificate.not_valid_after_utc:%Y-%m-%d}"
    _say(instructions.founded(str(options.folder), site, until, bool(protection)))
    return 0


def issue(options: argparse.Namespace) -> int:
    """Make a certificate for somebody who has none."""
    robots = (*options.robot, *([EVERY_ROBOT] if options.every else []))
    sources = options.source or (OPERATORS_SOURCES if options.role == "driver" else ())
    asked = profile(options.role, options.name, robots, options.address, sources)
    with locked(options.folder) as folder:
        member_list.check_free(folder.read(), asked.role, asked.name, time.time())
        _hand_out(folder, asked, options, settings=True)
    return 0


def renew(options: argparse.Namespace) -> int:
    """Make another certificate with the same rights."""
    with locked(options.folder) as folder:
        old = member_list.newest(folder.read(), options.role, options.name)
        robots = old.robots if old.role == "driver" else ()
        addresses = options.address or member_list.found_at(old)
        asked = profile(old.role, old.name, robots, addresses, old.sources)
        _hand_out(folder, asked, options, settings=False)
    _say(instructions.renewed(old.role, old.name, old))
    return 0


def revoke(options: argparse.Namespace) -> int:
    """Strike somebody off the list."""
    with locked(options.folder) as folder:
        left, struck = member_list.revoked(
            folder.read(), options.role, options.name, options.serial
        )
        folder.write(left)
        target = folder.path / f"{options.role}.{options.name}"
        _say(instructions.struck(struck, str(target), member_list.routers(left)))
    return 0


def show(options: argparse.Namespace) -> int:
    """List every certificate."""
    folder = Folder(options.folder)
    members, now_s = folder.read(), time.time()
    ends_s = certificate_from(folder.certificate()).not_valid_after_utc.timestamp()
    if options.json:
        output.line(report.as_json(members, ends_s, now_s))
        return 0
    until = f"{datetime.fromtimestamp(ends_s, UTC):%Y-%m-%d}"
    print(f"site {members.site}, CA until {until}\n")
    print(report.as_table(members, now_s))
    for line in report.advice(members, ends_s, now_s):
        print(f"\n{line}")
    return 0


def _hand_out(
    folder: Folder, asked: Profile, options: argparse.Namespace, *, settings: bool
) -> None:
    authority = folder.authority(options.ca_key, lambda: passphrase.known(options.passphrase_file))
    ends_s = authority.certificate.not_valid_after_utc.timestamp()
    issued = authority.issue(asked, span(time.time(), options.days, ends_s))
    members = member_list.added(folder.read(), issued.member)
    target = folder.hand_out(asked, issued, members, settings=settings)
    folder.write(members)
    _say(instructions.issued(asked, issued.member, str(target), member_list.routers(members)))


def _say(lines: Iterable[str]) -> None:
    for line in lines:
        print(line)


VERBS: dict[str, Callable[[argparse.Namespace], int]] = {
    "init": init, "issue": issue, "renew": renew, "revoke": revoke, "list": show,
}  # fmt: skip
