"""Hosts as network namespaces, and cables between them, by the command ``ip``."""

import contextlib
import ctypes
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple, TypeVar

CLONE_NEWTIME, CLONE_NEWNS, CLONE_NEWNET = 0x00000080, 0x00020000, 0x40000000  # linux/sched.h
LIBC = ctypes.CDLL(None, use_errno=True)  # os.setns and os.unshare are Python 3.12
T = TypeVar("T")


class End(NamedTuple):
    """One end of a cable, in a network of 24 bits."""

    host: str  # a namespace, the pid of a process in it, or empty: this one
    device: str
    addresses: tuple[str, ...] = ()  # none: the host sets up this end itself


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


@contextlib.contextmanager
def hosts(*names: str) -> Iterator[None]:
    """Make hosts while the context lasts; their cables end with them."""
    try:
        for name in names:
            ip("netns", "add", name)
            ip("-n", name, "link", "set", "lo", "up")
        yield
    finally:
        for name in names:
            ip("netns", "del", name, check=False)


def connect(one: End, other: End) -> None:
    """Connect two hosts by a cable; only the first one may be this host."""
    peer = ("type", "veth", "peer", "name", other.device, "netns", other.host)
    ip(*_on(one), "link", "add", one.device, *peer)
    for end in (one, other):
        for address in end.addresses:
            ip(*_on(end), "address", "add", f"{address}/24", "dev", end.device)
        if end.addresses:
            ip(*_on(end), "link", "set", end.device, "up")


def _on(end: End) -> tuple[str, ...]:
    return ("-n", end.host) if end.host else ()


def in_network(namespace: str, call: Callable[[], T]) -> T:
    """Return the result of a call in a network namespace; its sockets stay there."""

    def enter() -> T:
        with Path(namespace).open("rb") as file:
            _check(LIBC.setns(file.fileno(), 0))
        return call()

    with ThreadPoolExecutor(1) as thread:  # the namespace changes for this thread only
        return thread.submit(enter).result()


def unshare(namespaces: int) -> None:
    """Enter new namespaces; raise OSError when it is impossible."""
    _check(LIBC.unshare(namespaces))


def keep_mounts() -> None:
    """Keep the mounts of a new mount namespace in it."""
    subprocess.run(["mount", "--make-rprivate", "/"], check=True)


def _check(failed: int) -> None:
    if failed:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
