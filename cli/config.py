"""``t2 config``: what is in force and where each value came from."""

import argparse
import json

from cli.settings import Everything
from common.cli_args import add_sources, sources
from common.config import Loaded, load


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("--json", action="store_true", help="one JSON object")
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Print every setting with its value and origin."""
    loaded = load(Everything, sources(options))
    print(as_json(loaded) if options.json else as_table(loaded))
    return 0


def as_json(loaded: Loaded[Everything]) -> str:
    """Return path to value and origin."""
    settings = {
        path: {"value": setting.value, "origin": setting.origin}
        for path, setting in loaded.settings.items()
    }
    return json.dumps(settings, ensure_ascii=False)


def as_table(loaded: Loaded[Everything]) -> str:
    """Return a line for each setting: path, value, origin."""
    rows = [
        (path, json.dumps(setting.value, ensure_ascii=False), setting.origin)
        for path, setting in loaded.settings.items()
    ]
    wide = max(len(path) for path, _, _ in rows), max(len(value) for _, value, _ in rows)
    return "\n".join(
        f"{path:{wide[0]}}  {value:{wide[1]}}  {origin}" for path, value, origin in rows
    )
