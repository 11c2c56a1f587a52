"""On-board programs start fast and small: they import no unused packages."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ON_BOARD = (
    "cli.run.router", "services.bridge.__main__", "services.bridge.child",
    "services.safety.__main__", "services.odom.__main__",
)  # fmt: skip
# What each of them costs stands where it is done without. The rest is for laptops.
HEAVY = {
    "asyncio", "dataclasses", "email", "hashlib", "importlib.metadata", "shutil",
    "jinja2", "matplotlib", "mcap", "rich", "starlette", "structlog", "textual", "uvicorn",
    "ziaplot",
}  # fmt: skip


def imported(module: str) -> set[str]:
    """Return what stands in memory after an import, in a Python that measures nothing."""
    code = f"import sys, {module}; print(*sys.modules)"
    environ = {name: text for name, text in os.environ.items() if "COV" not in name}
    command = [sys.executable, "-c", code]
    ran = subprocess.run(command, env=environ, capture_output=True, text=True, check=True)
    return set(ran.stdout.split())


@pytest.mark.parametrize("module", ON_BOARD)
def test_what_is_heavy_stays_away(module: str) -> None:
    assert imported(module) & HEAVY == set()


def test_it_would_be_seen() -> None:
    assert imported("shutil") & HEAVY == {"shutil"}


def test_the_guard_knows_no_bus() -> None:
    assert "zenoh" not in imported("services.bridge.__main__")
    assert "zenoh" in imported("services.bridge.child")


IMPORTS_A_TEST = re.compile(
    r"^(from|import) tests(\.\w+)*\.test_\w+|^from tests(\.\w+)* import .*\btest_", re.M
)


def test_no_module_imports_a_test_module() -> None:
    tree = Path(__file__).parents[1]
    found = [
        path.relative_to(tree).as_posix()
        for folder in ("tests", "verification", "bench", "tools")
        for path in (tree / folder).rglob("*.py")
        if IMPORTS_A_TEST.search(path.read_text(encoding="utf-8"))
    ]
    assert found == []
