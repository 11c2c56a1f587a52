"""The crate's program, and Python environments with older versions of Zenoh."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "out" / "ros2-peer"
CRATE = Path(__file__).parent / "peer"
PROGRAM = "t2-ros2-peer"
UV = Path(sys.executable).with_name("uv")
XXHASH = "xxhash==4.1.0"


class BuildError(Exception):
    """A peer cannot be built."""


def has_cargo() -> bool:
    """Return whether cargo is installed."""
    return shutil.which("cargo") is not None


def crate() -> Path:
    """Build the crate; return its program."""
    target = OUT / "target"
    command = ["cargo", "build", "--quiet", "--manifest-path", str(CRATE / "Cargo.toml")]
    _run(command, {"CARGO_TARGET_DIR": str(target)})
    return target / "debug" / PROGRAM


def environment(zenoh: str) -> Path:
    """Make a Python environment with this version of Zenoh; return its Python."""
    folder = OUT / f"zenoh-{zenoh}"
    python = folder / "bin" / "python"
    if not python.exists():
        _run([str(UV), "venv", "--quiet", "--python", sys.executable, str(folder)])
    packages = [f"eclipse-zenoh=={zenoh}", XXHASH]
    install = [str(UV), "pip", "install", "--quiet", "--system-certs", "--only-binary", ":all:"]
    _run([*install, "--python", str(python), *packages])
    return python


def _run(command: list[str], env: dict[str, str] | None = None) -> None:
    done = subprocess.run(command, env=os.environ | (env or {}), capture_output=True, text=True)
    if done.returncode:
        raise BuildError(f"{' '.join(command[:3])}: {done.stderr.strip()[-1000:]}")
