"""``make audit``: known flaws of what a lock names. ``pip-audit`` asks, this judges the answer.

For ``pip-audit`` a package that its database does not know is none with a flaw, and behind a proxy
that finds nothing every lock looks clean. So what was not checked is counted here, and is no
success.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
ANSWER = ROOT / "out" / "audit.json"
CLEAN, FLAWED, UNKNOWN = 0, 1, 2
# An environment of its own, in uv's cache: none of what it brings is installed beside T2.
TOOL = (
    str(Path(sys.executable).parent / "uv"),
    "tool", "run", "--quiet", "--system-certs", "--python", sys.executable,
    "--from", "pip-audit==2.9.0", "pip-audit",
    "--disable-pip", "--require-hashes", "--progress-spinner", "off",
)  # fmt: skip

Package = dict[str, Any]  # as pip-audit writes it


def main(words: Sequence[str] | None = None, tool: Sequence[str] = TOOL) -> int:
    """Check a lock; 0: all of it is known and without flaws, 1: flaws, 2: not all was checked."""
    parser = argparse.ArgumentParser(prog="make audit")
    parser.add_argument("lock", nargs="?", default=str(ROOT / "requirements.lock"))
    lock = parser.parse_args(words).lock
    ANSWER.parent.mkdir(exist_ok=True)
    ANSWER.unlink(missing_ok=True)
    ran = subprocess.run(
        [*tool, "--format", "json", "--output", str(ANSWER), "--requirement", lock],
        stderr=subprocess.PIPE, text=True, check=False,
    )  # fmt: skip
    if not ANSWER.exists():
        reason = ran.stderr.strip().rpartition("\n")[2] or f"it ended with {ran.returncode}"
        print(f"NOT CHECKED: pip-audit did not get an answer: {reason}")
        return UNKNOWN
    packages = json.loads(ANSWER.read_text(encoding="utf-8"))["dependencies"]
    for line in told(packages):
        print(line)
    return verdict(packages)


def verdict(packages: Sequence[Package]) -> int:
    """Return the exit code; a flaw counts more than what is unknown."""
    if any(package.get("vulns") for package in packages):
        return FLAWED
    return UNKNOWN if not packages or unknown(packages) else CLEAN


def told(packages: Sequence[Package]) -> Iterator[str]:
    """Yield a line for each flaw, and one for the whole."""
    for package in packages:
        for flaw in package.get("vulns", []):
            fixed = ", ".join(flaw["fix_versions"]) or "no version yet"
            yield f"{package['name']} {package['version']}: {flaw['id']}, fixed in {fixed}"
    left = unknown(packages)
    checked = len(packages) - len(left)
    if left:
        yield f"NOT CHECKED: {len(left)} of {len(packages)}, which the database does not know or"
        yield f"  cannot be asked about: {', '.join(left)}"
    yield f"{checked} of {len(packages)} packages checked; the whole answer is in out/{ANSWER.name}"


def unknown(packages: Sequence[Package]) -> list[str]:
    """Return the names of those that were skipped."""
    return [package["name"] for package in packages if "skip_reason" in package]


if __name__ == "__main__":
    sys.exit(main())
