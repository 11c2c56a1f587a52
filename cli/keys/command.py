"""``t2 keys``: a site's own certificate authority: who gets on the bus, and as what.

``init`` makes it, ``issue`` a certificate, ``renew`` the next one, ``revoke`` takes one away,
``list`` shows them all. How to use it: docs/keys.md; what each role may do: docs/security.md.
"""

import argparse
from pathlib import Path

from cli.keys.profile import DAYS, OPERATORS_SOURCES
from common.errors import RobotError
from common.members import ROLES

FOLDER = Path("keys")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the five subcommands."""
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    _add_init(_verb(verbs, "init", "make the CA of a site"))
    _add_issue(_verb(verbs, "issue", "make a certificate, and the folder that goes to its machine"))
    _add_renew(_verb(verbs, "renew", "make the next certificate; the one before stays good"))
    _add_revoke(_verb(verbs, "revoke", "take somebody's certificates off the list of members"))
    shown = _verb(verbs, "list", "every certificate, and what ends soon")
    shown.add_argument("--json", action="store_true", help="one JSON object")


def run(options: argparse.Namespace) -> int:
    """Do what is asked; raise ``RobotError`` without the library for it."""
    try:
        from cli.keys.operations import VERBS
    except ModuleNotFoundError as error:
        raise RobotError(
            f"it needs {error.name}: install the extra `keys` (pip install -e '.[keys]')"
        ) from None
    return VERBS[options.verb](options)


def _verb(
    verbs: "argparse._SubParsersAction[argparse.ArgumentParser]", name: str, text: str
) -> argparse.ArgumentParser:
    parser = verbs.add_parser(name, help=text, description=text)
    parser.add_argument(
        "--folder", type=Path, default=FOLDER, help="where the CA lies; keys by default"
    )
    return parser


def _add_init(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--site", default="t2", metavar="NAME", help="t2 by default")
    parser.add_argument(
        "--passphrase", action="store_true", help="ask for one, to encrypt the CA's key"
    )
    _add_passphrase_file(parser)


def _add_issue(parser: argparse.ArgumentParser) -> None:
    _add_who(parser)
    parser.add_argument(
        "--robot", action="append", default=[], metavar="ID",
        help="for a driver: may move this robot; may be repeated",
    )  # fmt: skip
    parser.add_argument("--every", action="store_true", help="for a driver: may move every robot")
    parser.add_argument(
        "--source", action="append", default=[], metavar="NAME",
        help="for a driver: may ask for motion under this name alone, as in safety.sources; may be "
        f"repeated; {', '.join(OPERATORS_SOURCES)} by default",
    )  # fmt: skip
    _add_signing(parser)


def _add_renew(parser: argparse.ArgumentParser) -> None:
    _add_who(parser)
    _add_signing(parser)


def _add_revoke(parser: argparse.ArgumentParser) -> None:
    _add_who(parser)
    parser.add_argument(
        "--serial", type=_serial, help="the certificate whose name ends so, and no other"
    )


def _serial(text: str) -> str:
    if not text:  # a shell's variable that was not set, and all would be revoked
        raise argparse.ArgumentTypeError(
            "it is empty; `t2 keys list` shows serials, and without --serial all are revoked"
        )
    return text


def _add_who(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("role", choices=ROLES, metavar="ROLE", help=", ".join(ROLES))
    parser.add_argument("name", metavar="NAME", help="a robot's id; a person, a site")


def _add_signing(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--address", action="append", default=[], metavar="HOST",
        help="for a router: where it is dialled, an IP address or a name; may be repeated; "
        "a robot's are the manual's unless told; localhost is always among them",
    )  # fmt: skip
    parser.add_argument(
        "--days", type=int, default=DAYS, help=f"how long it is good; {DAYS} by default"
    )
    parser.add_argument(
        "--ca-key", type=Path, metavar="FILE", help="the CA's key, if kept elsewhere"
    )
    _add_passphrase_file(parser)


def _add_passphrase_file(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--passphrase-file", type=Path, metavar="FILE", help="holds the passphrase of the CA's key"
    )
