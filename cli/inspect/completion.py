"""``t2 completion``: what bash, zsh or fish want to complete ``t2``, made from its own parsers."""

import argparse
import shlex
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product

from cli.inspect.payload import kinds
from common.keys import CALLS, TOPICS

BASH = """\
# t2 for bash:  eval "$(t2 completion bash)"
COMP_WORDBREAKS=${{COMP_WORDBREAKS//@}}  # keys begin with one
_t2() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} words="" path
  local one=${{COMP_WORDS[1]}} two="${{COMP_WORDS[1]}} ${{COMP_WORDS[2]}}"
  case $before in
    {files}) COMPREPLY=(); return ;;
  esac
  if [ "$COMP_CWORD" -eq 1 ]; then
    words={commands}
  else
    [ "$COMP_CWORD" -eq 2 ] && two=$one
    for path in "$two" "$one"; do
      case $path in
{cases}
        *) continue ;;
      esac
      break
    done
  fi
  COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -F _t2 t2
"""
ZSH = """\
# t2 for zsh:  eval "$(t2 completion zsh)"
autoload -U +X compinit && compinit
autoload -U +X bashcompinit && bashcompinit
"""
FISH = """\
# t2 for fish:  t2 completion fish | source
complete -c t2 -f -n __fish_use_subcommand
"""
FILES = (
    "--config", "--report", "--out", "--trace", "--folder", "--ca-key", "--passphrase-file",
)  # fmt: skip
PLACEHOLDERS = {
    "{service}": ("bridge", "safety", "odom"),
    "{side}": ("left", "right"),
    "{source}": ("teleop", "web", "nav"),
}


@dataclass(slots=True)
class Node:
    """What may follow ``t2`` and the words of ``path``."""

    path: tuple[str, ...]
    options: dict[str, str] = field(default_factory=dict)  # with their help
    words: dict[str, str] = field(default_factory=dict)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("shell", choices=["bash", "zsh", "fish"])


def run(options: argparse.Namespace) -> int:
    """Print the shell's script."""
    script = {"bash": bash, "zsh": lambda tree: ZSH + bash(tree), "fish": fish}[options.shell]
    print(script(list(nodes())), end="")
    return 0


def nodes() -> Iterator[Node]:
    """Yield every command with what may follow it, ``t2`` itself first."""
    from cli.__main__ import COMMANDS, module  # it imports this module only when it is asked for

    yield Node((), words=dict(COMMANDS))
    for name in COMMANDS:
        parser = argparse.ArgumentParser()
        module(name).add_arguments(parser)
        yield from _walk((name,), parser)


def bash(tree: list[Node]) -> str:
    """Return the script for bash."""
    top, *rest = tree
    cases = "\n".join(
        f"        {shlex.quote(' '.join(node.path))}) words={_list(node)} ;;"
        for node in reversed(rest)
    )
    files = "|".join(FILES)
    return BASH.format(files=files, commands=shlex.quote(" ".join(top.words)), cases=cases)


def fish(tree: list[Node]) -> str:
    """Return the script for fish."""
    top, *rest = tree
    lines = [
        f"complete -c t2 -n __fish_use_subcommand -a {name} -d {shlex.quote(text)}"
        for name, text in top.words.items()
    ]
    for node in rest:
        seen = " ; and ".join(f"__fish_seen_subcommand_from {word}" for word in node.path)
        begin = f"complete -c t2 -n {shlex.quote(seen)}"
        for word, text in node.words.items():
            lines.append(f"{begin} -a {shlex.quote(word)} -d {shlex.quote(text)}")
        for option, text in node.options.items():
            takes = " -r -F" if option in FILES else ""
            lines.append(f"{begin} -l {option.removeprefix('--')} -d {shlex.quote(text)}{takes}")
    return FISH + "\n".join(lines) + "\n"


def _walk(path: tuple[str, ...], parser: argparse.ArgumentParser) -> Iterator[Node]:
    node, below = Node(path), list[Node]()
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            texts = {choice.dest: choice.help or "" for choice in action._choices_actions}
            for word, inner in action.choices.items():
                node.words[word] = texts.get(word, "")
                below += _walk((*path, word), inner)
        elif action.option_strings:
            long = [option for option in action.option_strings if option.startswith("--")]
            node.options |= dict.fromkeys(long, action.help or "")
        else:
            node.words |= _arguments(path[-1], action)
    return iter([node, *below])


def _arguments(command: str, action: argparse.Action) -> dict[str, str]:
    if action.choices:
        return {str(choice): "" for choice in action.choices}
    if command == "call" and action.metavar == "KEY":
        return {call.path.removeprefix("srv/"): call.what for call in CALLS}
    if command != "pub" and action.metavar == "KEY":
        return {path: topic.what for topic in TOPICS for path in _filled(topic.path)}
    if action.metavar == "TYPE":
        return dict.fromkeys(kinds(), "")
    return {}


def _filled(path: str) -> list[str]:
    """Return the paths of a row of the table, with what usually stands in its gaps."""
    parts = [PLACEHOLDERS.get(part, (part,)) for part in path.split("/")]
    return ["/".join(chosen) for chosen in product(*parts)]


def _list(node: Node) -> str:
    return shlex.quote(" ".join([*node.words, *node.options]))
