"""On-board programs start fast and small: they import no unused packages."""

import os
import subprocess
import sys

import pytest

ON_BOARD = (
    "cli.run.router", "services.bridge.__main__", "services.bridge.bridge",
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
    assert "zenoh" in imported("services.bridge.bridge")
