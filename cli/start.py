"""Entry point of the ``t2`` command: puts our packages ahead of others of the same names.

It imports nothing of ours before that; see ``common.child_process``.
"""

import sys
from pathlib import Path

ROOT = str(Path(__file__).resolve().parents[1])


def main() -> int:
    """Run the command; return its exit code."""
    sys.path.insert(0, ROOT)
    from cli.__main__ import main as run

    return run()
