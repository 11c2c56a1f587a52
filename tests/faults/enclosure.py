"""What a fault needs of the machine: a network, a disk, a clock or memory to take away.

The campaign moves into a network and mounts of its own, so that it can cut the one and fill the
other without touching the machine's. What cannot be had here is told with its reason, and the
faults that need it are left out.
"""

import contextlib
import ctypes
import os
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Literal

Need = Literal[
    "nothing", "a teleop", "a far driver", "a small disk", "other clocks", "a memory group"
]

CLONE_NEWNS, CLONE_NEWNET = 0x00020000, 0x40000000  # linux/sched.h
MEMORY = Path("/sys/fs/cgroup/memory")
TUN = Path("/dev/net/tun")
SMALL = "256k"


def enter() -> str:
    """Leave the machine's network and mounts; return why not, or nothing.

    To be called before there are threads: those that come later go along.
    """
    if not (shutil.which("ip") and shutil.which("mount")):
        return "the commands ip and mount are not here (Debian: apt-get install iproute2 mount)"
    if ctypes.CDLL(None, use_errno=True).unshare(CLONE_NEWNS | CLONE_NEWNET):
        return f"no network of its own: {os.strerror(ctypes.get_errno())}"
    subprocess.run(["mount", "--make-rprivate", "/"], check=True)
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    return ""


def missing(outside: str) -> Mapping[Need, str]:
    """Return what cannot be had, and why; ``outside`` says why ``enter`` did not work, if so."""
    writable = os.access(MEMORY, os.W_OK) and (MEMORY / "memory.limit_in_bytes").exists()
    reasons: dict[Need, str] = {
        "a far driver": outside or ("" if os.access(TUN, os.W_OK) else f"{TUN} cannot be opened"),
        "a small disk": outside,
        "other clocks": "" if faketime() else "no libfaketime (Debian: apt-get install faketime)",
        "a memory group": "" if writable else "no memory control group can be made",
    }
    return {need: reason for need, reason in reasons.items() if reason}


@contextlib.contextmanager
def small_disk(folder: Path) -> Iterator[None]:
    """Make a folder that is a small disk of its own while the context lasts."""
    folder.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={SMALL}", "t2", str(folder)], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)  # a bridge may still end


def faketime() -> Path | None:
    """Return the library that gives a process another clock."""
    found = sorted(Path("/usr/lib").glob("*/faketime/libfaketime.so.1"))
    return found[0] if found else None


def clock(file: Path) -> dict[str, str]:
    """Return an environment in which a process's time of day is off by what a file says."""
    return {
        **os.environ,
        "LD_PRELOAD": str(faketime()),
        "FAKETIME_TIMESTAMP_FILE": str(file),
        "FAKETIME_CACHE_DURATION": "1",  # s until a process sees that it was stepped
        "FAKETIME_DONT_FAKE_MONOTONIC": "1",
    }
