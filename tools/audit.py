"""``make audit``: known vulnerabilities of the packages in a lock file, by ``pip-audit``.

``pip-audit`` reports a package that its database does not know as clean, so behind a blocking proxy
every lock looks clean. This command counts unchecked packages and does not report success for them.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
RESULT = ROOT / "out" / "audit.json"
CLEAN, VULNERABLE, UNKNOWN = 0, 1, 2
# Its own environment in uv's cache: none of its packages is installed with T2.
TOOL = (
    str(Path(sys.executable).parent / "uv"),
    "tool", "run", "--quiet", "--system-certs", "--python", sys.executable,
    "--from", "pip-audit==2.9.0", "pip-audit",
    "--disable-pip", "--require-hashes", "--progress-spinner", "off",
)  # fmt: skip

Package = dict[str, Any]  # in the format of pip-audit


def main(words: Sequence[str] | None = None, tool: Sequence[str] = TOOL) -> int:
    """Check a lock file; 0: no vulnerabilities, 1: vulnerabilities, 2: not all was checked."""
    parser = argparse.ArgumentParser(prog="make audit")
    parser.add_argument("lock", nargs="?", default=str(ROOT / "requirements.lock"))
    lock = parser.parse_args(words).lock
    RESULT.parent.mkdir(exist_ok=True)
    RESULT.unlink(missing_ok=True)
    ran = subprocess.run(
        [*tool, "--format", "json", "--output", str(RESULT), "--requirement", lock],
        stderr=subprocess.PIPE, text=True, check=False,
    )  # fmt: skip
    if not RESULT.exists():
        reason = ran.stderr.strip().rpartition("\n")[2] or f"exit code {ran.returncode}"
        print(f"NOT CHECKED: pip-audit failed: {reason}")
        return UNKNOWN
    packages = json.loads(RESULT.read_text(encoding="utf-8"))["dependencies"]
    for line in report(packages):
        print(line)
    return verdict(packages)


def verdict(packages: Sequence[Package]) -> int:
    """Return the exit code; a vulnerability counts more than an unchecked package."""
    if any(package.get("vulns") for package in packages):
        return VULNERABLE
    return UNKNOWN if not packages or unknown(packages) else CLEAN


def report(packages: Sequence[Package]) -> Iterator[str]:
    """Yield a line for each vulnerability, and a summary."""
    for package in packages:
        for vulnerability in package.get("vulns", []):
            fixed = ", ".join(vulnerability["fix_versions"]) or "no version yet"
            yield f"{package['name']} {package['version']}: {vulnerability['id']}, fixed in {fixed}"
    left = unknown(packages)
    checked = len(packages) - len(left)
    if left:
        yield f"NOT CHECKED: {len(left)} of {len(packages)}, unknown to the database or"
        yield f"  not reachable: {', '.join(left)}"
    yield f"{checked} of {len(packages)} packages checked; full result in out/{RESULT.name}"


def unknown(packages: Sequence[Package]) -> list[str]:
    """Return the names of the skipped packages."""
    return [package["name"] for package in packages if "skip_reason" in package]


if __name__ == "__main__":
    sys.exit(main())
