"""``python -m tools.cores``: the files of the cores, for the coverage gate.

A core is a module that ships and imports nothing that the contract on cores in ``pyproject.toml``
forbids.
"""

import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

from grimp import build_graph

ROOT = Path(__file__).parent.parent
SHIPPED = ("common", "services", "sim", "cli")


def main() -> int:
    """Print the files as one pattern list for ``coverage report --include``."""
    print(",".join(sorted(cores())))
    return 0


def cores() -> Iterator[str]:
    """Yield the file of each core, relative to the checkout."""
    rules = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    forbidden = rules["tool"]["importlinter"]["contracts"][-1]["forbidden_modules"]
    graph = build_graph(*SHIPPED, include_external_packages=True, cache_dir=None)
    for module in graph.modules:
        imported = graph.find_modules_directly_imported_by(module)
        acts = any(
            one == name or one.startswith(f"{name}.") for one in imported for name in forbidden
        )
        file = f"{module.replace('.', '/')}.py"
        if not acts and (ROOT / file).is_file():
            yield file


if __name__ == "__main__":
    sys.exit(main())
