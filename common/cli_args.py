"""Command-line options, exit codes and version that all programs of T2 share."""

import argparse
import os
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from common.config import DEFAULT_FILE, Sources
from common.errors import ConfigError
from common.text import printable
from t2.errors import LinkError, T2Error
from t2.messages import VERSION as VERSION
from t2.text_file import expanded
from t2.words import LANGUAGES, Language

LANGUAGE_ENV = "T2_LANG"
LOCALE_ENV = ("LC_ALL", "LC_MESSAGES", "LANG")  # the first that is set counts, as for all programs
FILES_ENV = "T2_CONFIG"  # settings files, separated as in PATH; programs pass it to their children

EXIT_CONFIG = 78  # EX_CONFIG: a restart does not help
EXIT_LINK = 69  # EX_UNAVAILABLE: a port or an endpoint is taken
NO_RESTART = (EXIT_CONFIG, EXIT_LINK)
EXIT_CODES = {ConfigError: EXIT_CONFIG, LinkError: EXIT_LINK}  # of other errors: 1
WIDTH = 100  # characters, of a service's help


def arguments(name: str) -> argparse.ArgumentParser:
    """Return a parser with the options of every service."""
    # A fixed width: detecting the terminal's takes argparse 4 ms of each start (`shutil`).
    form = partial(argparse.HelpFormatter, width=WIDTH)
    parser = argparse.ArgumentParser(prog=name, formatter_class=form)
    add_sources(parser)
    return parser


def file_path(text: str) -> Path:
    """Parse a path; a shell does not expand ``~`` in ``--config=~/FILE``."""
    return Path(expanded(text))


def add_sources(parser: argparse.ArgumentParser) -> None:
    """Add the options that name sources of settings."""
    parser.add_argument(
        "--config", action="append", type=file_path, metavar="FILE", default=None,
        help="TOML file on top of config/t2.toml and of those in T2_CONFIG (FILE:FILE...); may be "
        "repeated, the last one wins",
    )  # fmt: skip
    parser.add_argument(
        "--set", action="append", dest="sets", metavar="PATH=VALUE", default=[],
        help="one setting, such as board.port=4002; overrides files and environment",
    )  # fmt: skip


def sources(options: argparse.Namespace) -> Sources:
    """Return the sources of settings named by the environment and the options."""
    try:
        words = filter(None, os.environ.get(FILES_ENV, "").split(os.pathsep))
        named = list(map(file_path, words))
    except ValueError as error:
        raise ConfigError(f"environment {FILES_ENV}: {error}") from None
    return Sources(files=(DEFAULT_FILE, *named, *(options.config or ())), sets=options.sets)


def source_words(options: argparse.Namespace) -> list[str]:
    """Return the options that name sources of settings, as given, for another program."""
    files = [word for file in options.config or () for word in ("--config", str(file))]
    return files + [word for text in options.sets for word in ("--set", text)]


def hint(command: str, words: Sequence[str]) -> str:
    """Return a command of ``t2`` to paste, with the options that name sources of settings."""
    return f"`{shlex.join(['t2', command, *words])}`"


def reader_language(environ: Mapping[str, str] = os.environ) -> Language:
    """Return the language of screens: that of ``T2_LANG``, otherwise of the locale.

    Raise ``ConfigError`` if ``T2_LANG`` is another one.
    """
    if chosen := environ.get(LANGUAGE_ENV):
        for language in LANGUAGES:
            if chosen == language:
                return language
        names = " or ".join(LANGUAGES)
        raise ConfigError(f"environment {LANGUAGE_ENV}: {chosen!r} is unknown; use {names}")
    locale = next(filter(None, map(environ.get, LOCALE_ENV)), "")
    return "zh" if locale.startswith("zh") else "en"


def add_setting(parser: argparse.ArgumentParser, option: str, path: str, text: str) -> None:
    """Add an option for one setting; it has the effect of ``--set PATH=VALUE``."""
    parser.add_argument(
        option, action="append", dest="sets", metavar=option[2:].upper(), default=[],
        type=lambda value: f"{path}={value}", help=text,
    )  # fmt: skip


def run_program(
    name: str,
    add_arguments: Callable[[argparse.ArgumentParser], None],
    run: Callable[[argparse.Namespace], int],
    argv: Sequence[str] | None,
    what: str | None = None,
) -> int:
    """Run a program with its options and return its exit code, as for every service."""
    parser = argparse.ArgumentParser(prog=name, description=what)
    add_arguments(parser)
    options = parser.parse_args(argv)
    try:
        return run(options)
    except T2Error as error:
        print(printable(f"{name}: {error}", "\n"), file=sys.stderr)  # noqa: T201 - logs may not be set up yet
        return EXIT_CODES.get(type(error), 1)


@contextmanager
def needs_extra(extra: str, what: str) -> Iterator[None]:
    """Raise ``T2Error`` that names the extra if an import in the block finds no library."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise T2Error(
            f"{what} needs {error.name}: install the extra `{extra}` (pip install -e '.[{extra}]')"
        ) from None
