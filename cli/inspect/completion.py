"""``t2 completion``: shell completion by argcomplete, from the parsers of the commands.

The shell's script starts ``t2`` at each Tab with ``_ARGCOMPLETE`` set; ``complete`` then answers
from the parser of the command that is being typed. See docs/decisions.md#libraries.
"""

import argparse
import os
from pathlib import Path

import argcomplete
from argcomplete.completers import FilesCompleter, SuppressCompleter
from argcomplete.shell_integration import shellcode

from common.keys import CALLS, TOPICS

ZSH = "autoload -Uz compinit && compinit\n"
PLACEHOLDERS = {
    "{service}": ("bridge", "safety", "odom"),
    "{side}": ("left", "right"),
    "{source}": ("teleop", "web", "nav", "ros2"),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "shell", choices=["bash", "zsh", "fish"],
        help='bash and zsh: eval "$(t2 completion SHELL)"; fish: t2 completion fish | source',
    )  # fmt: skip


def run(options: argparse.Namespace) -> int:
    """Print the script for a shell."""
    script = shellcode(["t2"], shell=options.shell)
    print(ZSH * (options.shell == "zsh") + script, end="")
    return 0


def complete(parser: argparse.ArgumentParser) -> None:
    """Print the candidates for the line in the shell, and end the process."""
    add_completers("t2", parser)
    argcomplete.autocomplete(
        parser, always_complete_options="long", default_completer=SuppressCompleter()
    )


def typed_command() -> str:
    """Return the subcommand on the shell's line, as far as it is typed."""
    words = os.environ.get("COMP_LINE", "").split()
    return words[1] if len(words) > 1 else ""


def add_completers(command: str, parser: argparse.ArgumentParser) -> None:
    """Attach the candidates of keys and files to a parser and its subparsers."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, inner in action.choices.items():
                add_completers(name, inner)
        elif action.type is Path or "FILE" in str(action.metavar):
            setattr(action, "completer", FilesCompleter())  # noqa: B010 (no attribute of Action)
        elif action.metavar == "KEY":
            words = calls() if command == "call" else topics()
            setattr(action, "completer", lambda words=words, **_: words)  # noqa: B010


def calls() -> dict[str, str]:
    """Return the keys of the calls with their help."""
    return {call.path.removeprefix("srv/"): call.what for call in CALLS}


def topics() -> dict[str, str]:
    """Return the keys of the topics, with the usual values of their placeholders."""
    found = {}
    for topic in TOPICS:
        names = [name for name in PLACEHOLDERS if name in topic.path]
        values = [(name, value) for name in names for value in PLACEHOLDERS[name]]
        for name, value in values or [("", "")]:
            found[topic.path.replace(name, value)] = topic.what
    return found
