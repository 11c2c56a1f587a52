"""Entry point of the ``t2`` command: puts our packages first in ``sys.path``, and checks them.

It imports none of them before that: other packages may have the same names. See
``common.child_process``. In an environment that T2 shares, another package can also overwrite our
files, or add modules to our packages: the list of files in the wheel shows it.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]
SDK = HERE / "sdk"  # in a checkout, the folder of t2
PACKAGES = ("t2", "common", "services", "sim", "cli")
FOLDERS = tuple(f"{name}/" for name in PACKAGES)
EXIT_CONFIG = 78  # as in ``common.cli_args``, which may be foreign
REMEDY = (
    "Install T2 in an environment of its own: python3 -m venv FOLDER, then "
    "FOLDER/bin/pip install and T2's wheel. Your own programs need only the package of T2's folder "
    "sdk (docs/integrate.md)"
)

TRIED = "t2 estop: it is tried; without its confirmation USE THE VEHICLE'S OWN SWITCH"


def main() -> int:
    """Run the command; return its exit code."""
    sys.path[:0] = [str(folder) for folder in (HERE, SDK) if folder.exists()]
    problem = next(foreign(HERE), "")
    if problem:
        print(f"t2: {problem}. {REMEDY}", file=sys.stderr)
        if sys.argv[1:2] != ["estop"]:
            return EXIT_CONFIG
        print(TRIED, file=sys.stderr)
    from cli.__main__ import main as run

    return run()


def foreign(root: Path) -> Iterator[str]:
    """Yield what is not ours in our packages; a wheel's list has the size of each file."""
    records = [*root.glob("t2-*.dist-info/RECORD"), *root.glob("t2_sdk-*.dist-info/RECORD")]
    rows = (line.rsplit(",", 2) for it in records for line in it.read_text("utf-8").splitlines())
    sizes = {path: size for path, _, size in rows if path.startswith(FOLDERS)}
    if sizes:
        found = dict(each for name in PACKAGES for each in _modules(f"{root}/{name}", f"{name}/"))
        for path, size in sizes.items():
            if path.endswith(".py") and found.get(path) != int(size):
                state = "is not the file of T2" if path in found else "is missing"
                yield f"{root / path} {state}{_owner(root, path)}"
        for path in found:
            if path not in sizes:
                yield f"{root / path} is in a package of T2, but not of T2{_owner(root, path)}"
    for name in PACKAGES:
        place = import_module(name).__file__
        ours = next(folder for folder in (root / name, root / "sdk" / name) if folder.exists())
        if place is None or Path(place).resolve() != ours / "__init__.py":
            yield f"Python imports {place or name} as the package {name}, not {ours}"


def _modules(folder: str, below: str) -> Iterator[tuple[str, int]]:
    """Yield path and size of the modules in a folder; paths as in a wheel's list."""
    with suppress(FileNotFoundError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir() and entry.name != "__pycache__":
                yield from _modules(entry.path, f"{below}{entry.name}/")
            elif entry.name.endswith(".py"):
                yield below + entry.name, entry.stat().st_size


def _owner(root: Path, path: str) -> str:
    """Return which other package has installed a file, if its list of files shows it."""
    for record in root.glob("*.dist-info/RECORD"):
        name = record.parent.name.removesuffix(".dist-info")
        is_ours = name.startswith(("t2-", "t2_sdk-"))
        if not is_ours and f"\n{path}," in "\n" + record.read_text("utf-8"):
            return f": {name} has installed it"
    return ""
