"""``t2 keys``: the certificate authority of a site; its certificates grant access to the bus.

``init`` creates the authority, ``issue`` and ``renew`` create certificates, ``revoke`` revokes them
and ``list`` shows them. Guide: docs/keys.md; rights of each role: docs/security.md.
"""

import argparse
from pathlib import Path

from cli.keys.member_list import DAYS
from common.cli_args import needs_extra
from common.members import OPERATORS_SOURCES, ROLES

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
    _add_rights(issue)
    _add_signing(issue)
    _add_signing(renew)
    revoke.add_argument(
        "--serial", type=_serial, help="only the certificate whose name ends with this serial"
    )


def run(options: argparse.Namespace) -> int:
    """Run the operation; raise ``RobotError`` if the library is missing."""
    with needs_extra("keys", "it"):
        from cli.keys.operations import OPERATIONS
    return OPERATIONS[options.verb](options)


def _verb(
    verbs: "argparse._SubParsersAction[argparse.ArgumentParser]", name: str, text: str
) -> argparse.ArgumentParser:
    parser = verbs.add_parser(name, help=text, description=text)
    parser.add_argument(
        "--folder", type=Path, default=FOLDER, help="folder of the CA; keys by default"
    )
    return parser


def _add_rights(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--robot", action="append", default=[], metavar="ID",
        help="for a driver, device or ros: allow this robot; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--every", action="store_true", help="for a driver, device or ros: allow every robot"
    )
    parser.add_argument(
        "--source", action="append", default=[], metavar="NAME",
        help="for a driver or device: allow only this source, as in safety.sources or "
        f"safety.limits; may be repeated; by default {', '.join(OPERATORS_SOURCES)} for a driver, "
        "which may also reset; NAME for a device",
    )  # fmt: skip


def _add_signing(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--address", action="append", default=[], metavar="HOST",
        help="for a router: its IP address or host name; may be repeated; a robot has the manual's "
        "addresses by default; localhost is always included",
    )  # fmt: skip
    parser.add_argument(
        "--days", type=int, default=DAYS, help=f"validity in days; {DAYS} by default"
    )
    parser.add_argument(
        "--ca-key", type=Path, metavar="FILE", help="the CA's key, if it is stored elsewhere"
    )


def _serial(text: str) -> str:
    if not text:  # an unset shell variable must not revoke all
        raise argparse.ArgumentTypeError(
            "is empty; `t2 keys list` shows serials, and without --serial all are revoked"
        )
    return text
