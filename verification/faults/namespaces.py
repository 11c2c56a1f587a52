"""Namespaces for faults of network, disk and clock.

The campaign moves into its own network and mount namespaces, so that it can cut the network and
fill a disk without affecting the machine.
"""

import contextlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from common.freshness import NS_PER_S
from verification.harness.network_hosts import (
    CLONE_NEWNET,
    CLONE_NEWNS,
    End,
    connect,
    hosts,
    ip,
    keep_mounts,
    unshare,
)

TOOLS = {"ip": "iproute2", "mount": "mount", "cc": "gcc"}  # and their Debian packages
TUN = Path("/dev/net/tun")
CLOCK = Path(__file__).with_name("clock.c")
SMALL = "256k"
RELAY_HOST = f"t2relay{os.getpid()}"
# Of each cable of the relay: the address of the PC or the board, then the relay's.
RELAY_CABLES = {"pc": ("10.7.6.2", "10.7.6.1"), "board": ("10.7.5.224", "10.7.5.220")}


def enter() -> None:
    """Enter new network and mount namespaces; raise OSError with the reason when it is impossible.

    Call it before any thread starts: only later threads share the namespaces.
    """
    lacking = [package for tool, package in TOOLS.items() if not shutil.which(tool)]
    if lacking:
        raise OSError(f"not installed: apt-get install {' '.join(lacking)}")
    if not os.access(TUN, os.W_OK):
        raise OSError(f"{TUN} cannot be opened; root is required")
    unshare(CLONE_NEWNS | CLONE_NEWNET)
    keep_mounts()
    ip("link", "set", "lo", "up")


@contextlib.contextmanager
def small_disk(folder: Path) -> Iterator[None]:
    """Mount a small disk on a new folder while the context lasts."""
    folder.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={SMALL}", "t2", str(folder)], check=True)
    try:
        yield
    finally:  # lazy: a bridge may still be ending
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def clock(file: Path) -> dict[str, str]:
    """Return variables whose processes have a time of day shifted by the content of a file."""
    library = file.with_suffix(".so")
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", library, CLOCK, "-ldl"], check=True)
    own = {"LD_PRELOAD": str(library), "T2_CLOCK": str(file)}
    step_clock(file, 3600)  # to detect a library that the loader ignores
    date = ["date", "+%s"]
    seen = subprocess.run(date, env=os.environ | own, capture_output=True, text=True, check=True)
    assert int(seen.stdout) - time.time() > 3000, f"the clock does not step: {seen.stderr}"
    step_clock(file, 0)
    return own


def step_clock(file: Path, seconds: int, slept: int = 0) -> None:
    """Set the shift of the time of day of all processes that use this file, and their sleep."""
    with file.open("r+b" if file.exists() else "wb") as it:  # in place: it is mapped
        for shift in (seconds, slept):
            it.write((shift * NS_PER_S).to_bytes(8, sys.byteorder, signed=True))


@contextlib.contextmanager
def relay_host() -> Iterator[None]:
    """Make the relay's host with a cable to the PC and one to the board.

    PC and board share the campaign's namespace: each has its own address and cable there, and all
    their datagrams cross the relay.
    """
    with hosts(RELAY_HOST):
        for side, (there, ours) in RELAY_CABLES.items():
            connect(End("", f"cable-{side}", (there,)), End(RELAY_HOST, side, (ours,)))
        yield
