"""Hosts as network namespaces, by the command ``ip``."""

import os
import shutil
import subprocess


def ip(*words: str, check: bool = True) -> "subprocess.CompletedProcess[str]":
    """Run ``ip``."""
    return subprocess.run(["ip", *words], check=check, capture_output=True, text=True)


def missing(name: str) -> str:
    """Return why no host can be made, tried with this name; empty if it can."""
    if os.geteuid() != 0 or not shutil.which("ip"):
        return "network namespaces need root and `ip` (Debian: iproute2)"
    made = ip("netns", "add", name, check=False)
    ip("netns", "del", name, check=False)
    return made.stderr.strip()
