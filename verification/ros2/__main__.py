"""Run the gateway against independent ROS 2 peers, and print a table."""

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from functools import partial
from pathlib import Path

from common.freshness import NS_PER_S
from verification.harness.results import table
from verification.harness.trace import moves
from verification.ros2 import hiroz, plain_peer, rclpy_oracle
from verification.ros2.hiroz import Robot, robot_with_gateway

OUT = Path(__file__).resolve().parents[2] / "out" / "ros2-peer"
CRATE = Path(__file__).parent / "peer"
UV = Path(sys.executable).with_name("uv")
VERSIONS = "1.6.2", "1.7.2", "1.9.0"  # of Zenoh
DRIVES = "topic_pub", "keyboard", "planner", "after_pause", "after_reset"
STOPPED_S = 6.0  # from the stop to the first motion: halts, and a drive that is refused
Check = Callable[[Robot], str]


def main() -> int:
    """Return 1 when a check fails; without cargo those of hiroz are skipped."""
    parser = argparse.ArgumentParser(prog="python -m verification.ros2", description=__doc__)
    parser.add_argument("--only", metavar="TEXT", default="", help="checks with this text in name")
    parser.add_argument("--pause", type=float, default=70.0, help="of a planner, in seconds")
    options = parser.parse_args()
    chosen = {name: it for name, it in checks(options.pause).items() if options.only in name}
    if not shutil.which("cargo"):
        print("hiroz is skipped: cargo is not installed; install Rust from https://rustup.rs")
        chosen = {name: it for name, it in chosen.items() if not name.startswith("hiroz")}
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # ends the processes of the check
    node = Path()  # of the checks with hiroz
    if any(name.startswith("hiroz") for name in chosen):
        print("building the peer; the first time takes several minutes", flush=True)
        node = build_crate()
    rows = [run(name, check, node) for name, check in chosen.items()]
    print(f"\n{table(('check', 'observation', ''), rows)}")
    return 1 if any(mark != "ok" for *_, mark in rows) else 0


def checks(pause_s: float) -> dict[str, Check]:
    """Return the checks by name."""
    found: dict[str, Check] = {f"hiroz {check.__name__}": check for check in hiroz.CHECKS}
    found["ROS tools"] = partial(exercised, python=Path(sys.executable), pause_s=pause_s)
    found["rclpy of Jazzy"] = with_rclpy
    return found | {f"zenoh {version}": partial(older, version=version) for version in VERSIONS}


def older(robot: Robot, version: str) -> str:
    """Run the plain peer with this version of Zenoh."""
    packages = f"eclipse-zenoh=={version}", "xxhash==4.1.0"
    return exercised(robot, build_environment(f"zenoh-{version}", *packages))


def with_rclpy(robot: Robot) -> str:
    """Compare types and payloads with rclpy."""
    return rclpy_oracle.check(robot, build_environment("rclpy", *rclpy_oracle.PACKAGES))


def exercised(robot: Robot, python: Path, pause_s: float = 2.0) -> str:
    """Run the plain peer; compare what it did with the board's commands."""
    command = [str(python), "-P", plain_peer.__file__, robot.stack.endpoint, str(pause_s)]
    patience_s = 120.0 + pause_s
    done = subprocess.run(command, capture_output=True, text=True, timeout=patience_s, check=False)
    assert done.returncode == 0, done.stderr[-800:]
    found = json.loads(done.stdout.splitlines()[-1])
    assert '<robot name="t2">' in found["description"], found["description"][:80]
    assert "ros2.cmd_vel" in found["parameters"], found["parameters"]
    assert found["stop"][0], found
    assert found["reset"][0], found
    assert found["across_reset"] == 0, found
    moved = {name: found[name] for name in DRIVES}
    assert min(moved.values()) > 0.1, found
    commands = robot.stack.trace().commands
    moving = next(index for index, each in enumerate(commands) if moves(each))
    brake_ns = next(each.mono_ns for each in commands[moving:] if each.kind == "brake")
    resumed_ns = next(each.mono_ns for each in commands if moves(each) and each.mono_ns > brake_ns)
    assert resumed_ns - brake_ns > STOPPED_S * NS_PER_S, "motion after the stop"
    driven = ", ".join(f"{name} {metres:.2f}" for name, metres in moved.items())
    return f"Zenoh {found['zenoh']}, in m: {driven}; no motion across the reset"


def run(name: str, check: Check, node: Path) -> tuple[str, str, str]:
    """Run a check on a stack of its own, so that a failed one does not disturb the next."""
    began_s = time.monotonic()
    try:
        with (
            tempfile.TemporaryDirectory() as folder,
            robot_with_gateway(Path(folder), node) as robot,
        ):
            row = name, f"{check(robot)} ({time.monotonic() - began_s:.0f} s)", "ok"
    except Exception as error:
        traceback.print_exc()
        row = name, f"{type(error).__name__}: {error}"[:300], "FAILED"
    print(" ".join(row), flush=True)
    return row


def build_crate() -> Path:
    """Build the crate; return its program."""
    command = ["cargo", "build", "--quiet", "--manifest-path", str(CRATE / "Cargo.toml")]
    target = OUT / "target"
    subprocess.run(command, env=os.environ | {"CARGO_TARGET_DIR": str(target)}, check=True)
    return target / "debug" / "t2-ros2-peer"


def build_environment(name: str, *packages: str) -> Path:
    """Make a Python environment with these packages; return its Python."""
    folder = OUT / name
    python = folder / "bin" / "python"
    if not python.exists():
        subprocess.run([UV, "venv", "--quiet", "--python", sys.executable, folder], check=True)
    install = [
        str(UV), "pip", "install", "--quiet", "--system-certs", "--only-binary", ":all:",
        "--python", str(python), *packages,
    ]  # fmt: skip
    subprocess.run(install, check=True)
    return python


if __name__ == "__main__":
    sys.exit(main())
