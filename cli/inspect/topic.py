"""``t2 topic``: the words of ``ros2 topic``, for those who have them in their fingers."""

import argparse
from types import ModuleType

from cli.inspect import bw, delay, echo, hz, info, ls, pub

WORDS: dict[str, tuple[ModuleType, str]] = {
    "list": (ls, "the keys that are alive; also `t2 ls`"),
    "info": (info, "what a key carries, who publishes it and who reads it"),
    "echo": (echo, "show what comes; also `t2 echo`"),
    "hz": (hz, "its rate; also `t2 hz`"),
    "delay": (delay, "its delay; also `t2 delay`"),
    "bw": (bw, "its bandwidth; also `t2 bw`"),
    "pub": (pub, "publish; also `t2 pub`"),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add a parser for each word."""
    words = parser.add_subparsers(dest="word", required=True, metavar="WORD")
    for word, (module, text) in WORDS.items():
        module.add_arguments(words.add_parser(word, help=text, description=text))


def run(options: argparse.Namespace) -> int:
    """Run the word's own tool."""
    code: int = WORDS[options.word][0].run(options)
    return code
