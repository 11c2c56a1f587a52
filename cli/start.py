"""Entry point of the ``t2`` command: puts our packages first in ``sys.path``.

It imports none of them before that: other packages may have the same names. See
``common.child_process``.
"""

import sys
from pathlib import Path

ROOT = str(Path(__file__).resolve().parents[1])


def main() -> int:
    """Run the command; return its exit code."""
    sys.path.insert(0, ROOT)
    from cli.__main__ import main as run

    return run()
