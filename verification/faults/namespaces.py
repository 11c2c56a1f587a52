"""Namespaces for faults of network, disk, clock and memory.

The campaign moves into its own network and mount namespaces, so that it can cut the network and
fill a disk without affecting the machine. Faults whose requirement is not available are left out,
with the reason.
"""

import contextlib
import ctypes
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Literal

from common.freshness import NS_PER_S

Requirement = Literal[
    "none",
    "teleop",
    "remote driver",
    "third parties",
    "small disk",
    "separate clocks",
    "memory cgroup",
    "relay",
]

CLONE_NEWNS, CLONE_NEWNET = 0x00020000, 0x40000000  # linux/sched.h
MEMORY = Path("/sys/fs/cgroup/memory")
TUN = Path("/dev/net/tun")
CLOCK = Path(__file__).with_name("clock.c")
SMALL = "256k"


def enter() -> str:
    """Enter new network and mount namespaces; return the reason when that is impossible.

    Call it before any thread starts: only later threads share the namespaces.
    """
    if not (shutil.which("ip") and shutil.which("mount")):
        return (
            "the commands ip and mount are not installed (Debian: apt-get install iproute2 mount)"
        )
    if ctypes.CDLL(None, use_errno=True).unshare(CLONE_NEWNS | CLONE_NEWNET):
        return f"cannot create a network namespace: {os.strerror(ctypes.get_errno())}"
    subprocess.run(["mount", "--make-rprivate", "/"], check=True)
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    return ""


def missing(outside: str) -> Mapping[Requirement, str]:
    """Return the missing requirements with reasons; ``outside`` is the reason of ``enter``."""
    writable = os.access(MEMORY, os.W_OK) and (MEMORY / "memory.limit_in_bytes").exists()
    reasons: dict[Requirement, str] = {
        "remote driver": outside or ("" if os.access(TUN, os.W_OK) else f"{TUN} cannot be opened"),
        "small disk": outside,
        "relay": outside,
        "separate clocks": ""
        if shutil.which("cc")
        else "no C compiler (Debian: apt-get install gcc libc6-dev)",
        "memory cgroup": "" if writable else "cannot create a memory cgroup (version 1)",
    }
    return {need: reason for need, reason in reasons.items() if reason}


@contextlib.contextmanager
def small_disk(folder: Path) -> Iterator[None]:
    """Mount a small disk on a new folder while the context lasts."""
    folder.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={SMALL}", "t2", str(folder)], check=True)
    try:
        yield
    finally:
        subprocess.run(
            ["umount", "--lazy", str(folder)], check=True
        )  # a bridge may still be ending


def clock(file: Path) -> dict[str, str]:
    """Return an environment whose processes have a time of day shifted by the content of a file."""
    library = file.with_suffix(".so")
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", library, CLOCK, "-ldl"], check=True)
    env = {**os.environ, "LD_PRELOAD": str(library), "T2_CLOCK": str(file)}
    step_clock(file, 3600)  # to detect a library that the loader ignores
    seen = subprocess.run(["date", "+%s"], env=env, capture_output=True, text=True, check=True)
    assert int(seen.stdout) - time.time() > 3000, f"the clock does not step: {seen.stderr}"
    step_clock(file, 0)
    return env


def step_clock(file: Path, seconds: int, slept: int = 0) -> None:
    """Set the shift of the time of day of all processes that use this file, and their sleep."""
    with file.open("r+b" if file.exists() else "wb") as it:  # in place: it is mapped
        for shift in (seconds, slept):
            it.write((shift * NS_PER_S).to_bytes(8, sys.byteorder, signed=True))
