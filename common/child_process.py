"""Python child processes that import this project's packages and no others of the same names.

``common`` and ``services`` are generic names (docs/adr/0001-import-names.md). A folder of that
name in the working directory, or on PYTHONPATH as in every ROS workspace, must not be imported in
place of ours.
"""

import os
import sys
from pathlib import Path

ROOT = str(Path(__file__).resolve().parents[1])  # the folder of our packages
VARIABLE = "PYTHONPATH"


def command(module: str, *words: str) -> list[str]:
    """Return the command that runs a module of ours; start it with ``environ``."""
    return [sys.executable, "-P", "-m", module, *words]  # -P: without the working directory


def environ() -> dict[str, str]:
    """Return this process' environment, with our packages ahead of all others."""
    others = [path for path in os.environ.get(VARIABLE, "").split(os.pathsep) if path != ROOT]
    paths = [ROOT, *filter(None, others)]
    return os.environ | {VARIABLE: os.pathsep.join(paths)}
