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
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Literal

from common.freshness import NS_PER_S

Need = Literal[
    "nothing", "a teleop", "a far driver", "a small disk", "other clocks", "a memory group"
]

CLONE_NEWNS, CLONE_NEWNET = 0x00020000, 0x40000000  # linux/sched.h
MEMORY = Path("/sys/fs/cgroup/memory")
TUN = Path("/dev/net/tun")
CLOCK = Path(__file__).with_name("clock.c")
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
        "other clocks": ""
        if shutil.which("cc")
        else "no C compiler (Debian: apt-get install gcc libc6-dev)",
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


def clock(file: Path) -> dict[str, str]:
    """Return an environment in which a process's time of day is off by what a file says."""
    library = file.with_suffix(".so")
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", library, CLOCK, "-ldl"], check=True)
    env = {**os.environ, "LD_PRELOAD": str(library), "T2_CLOCK": str(file)}
    step_clock(file, 3600)  # a library that cannot be loaded is passed over: then nothing is tried
    seen = subprocess.run(["date", "+%s"], env=env, capture_output=True, text=True, check=True)
    assert int(seen.stdout) - time.time() > 3000, f"the clock does not step: {seen.stderr}"
    step_clock(file, 0)
    return env


def step_clock(file: Path, seconds: int) -> None:
    """Step the time of day of all that run by this file: to so much beside the machine's."""
    with file.open("r+b" if file.exists() else "wb") as it:  # in place: it is mapped
        it.write((seconds * NS_PER_S).to_bytes(8, sys.byteorder, signed=True))
