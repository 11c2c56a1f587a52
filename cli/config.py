"""``t2 config``: show the effective configuration and the source of each value."""

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
    """Print every setting with its value and source."""
    loaded = load(Everything, sources(options))
    print(as_json(loaded) if options.json else as_table(loaded))
    return 0


def as_json(loaded: Loaded[Everything]) -> str:
    """Return value and source of each setting, by path."""
    settings = {
        path: {"value": setting.value, "origin": setting.origin}
        for path, setting in loaded.settings.items()
    }
    return json.dumps(settings, ensure_ascii=False)


def as_table(loaded: Loaded[Everything]) -> str:
    """Return one line per setting: path, value, source."""
    rows = [
        (path, json.dumps(setting.value, ensure_ascii=False), setting.origin)
        for path, setting in loaded.settings.items()
    ]
    widths = max(len(path) for path, _, _ in rows), max(len(value) for _, value, _ in rows)
    return "\n".join(
        f"{path:{widths[0]}}  {value:{widths[1]}}  {origin}" for path, value, origin in rows
    )
