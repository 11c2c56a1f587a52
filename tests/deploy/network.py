"""A vehicle's network of namespaces: industrial PC, cable, Wi-Fi."""

import contextlib
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence

PATIENCE_S = 30.0
NEEDS = ("ip", "nft")
NAME = f"t2nft{os.getpid()}"
PC, CABLE, WIFI, OFFICE, BOX = (f"{NAME}{each}" for each in ("pc", "cable", "wifi", "lan", "box"))


def missing() -> str:
    """Return why this host cannot create the network; empty if it can."""
    if os.geteuid() != 0:
        return "network namespaces need root"
    absent = [name for name in NEEDS if not shutil.which(name)]
    if absent:
        return f"missing: {', '.join(absent)} (Debian: iproute2, nftables)"
    made = subprocess.run(["ip", "netns", "add", NAME], capture_output=True, text=True, check=False)
    if made.returncode:
        return f"cannot create a network namespace: {made.stderr.strip()}"
    table = within(NAME, "nft", "add", "table", "inet", "t2", check=False)
    run("ip", "netns", "del", NAME)
    return "" if table.returncode == 0 else f"the kernel has no nftables: {table.stderr.strip()}"


@contextlib.contextmanager
def vehicle() -> Iterator[None]:
    """Create the cable with board and stranger, the Wi-Fi with a laptop, and two more networks.

    These are an unrelated network, and a container network with published ports.
    """
    names = (PC, CABLE, WIFI, OFFICE, BOX)
    try:
        for name in names:
            run("ip", "netns", "add", name)
            within(name, "ip", "link", "set", "lo", "up")
        link(CABLE, "cable0", "10.7.5.220/24", ("10.7.5.224/24", "10.7.5.99/24"))
        link(WIFI, "wifi0", "192.168.201.1/24", ("192.168.201.50/24",))
        link(OFFICE, "office0", "10.0.9.1/24", ("10.0.9.50/24",))
        link(BOX, "box0", "172.30.0.1/24", ("172.30.0.2/24",))
        within(OFFICE, "ip", "route", "add", "default", "via", "10.0.9.1")
        within(BOX, "ip", "route", "add", "default", "via", "172.30.0.1")
        within(PC, "sysctl", "-qw", "net.ipv4.ip_forward=1")
        within(WIFI, "ip", "route", "add", "10.7.5.0/24", "via", "192.168.201.1")
        within(CABLE, "ip", "route", "add", "192.168.201.0/24", "via", "10.7.5.220")
        for at in ("all", "cable0", "wifi0"):  # the rules must detect spoofing, not the kernel
            within(PC, "sysctl", "-qw", f"net.ipv4.conf.{at}.rp_filter=0")
        yield
    finally:
        for name in names:
            subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)


def link(peer: str, device: str, ours: str, theirs: Sequence[str]) -> None:
    """Connect the PC and another namespace."""
    run("ip", "link", "add", device, "netns", PC, "type", "veth",
        "peer", "name", "there", "netns", peer)  # fmt: skip
    within(PC, "ip", "address", "add", ours, "dev", device)
    within(PC, "ip", "link", "set", device, "up")
    for address in theirs:
        within(peer, "ip", "address", "add", address, "dev", "there")
    within(peer, "ip", "link", "set", "there", "up")


def run(*words: str, check: bool = True) -> "subprocess.CompletedProcess[str]":
    """Run a command to completion."""
    return subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE_S, check=check)


def within(name: str, *words: str, check: bool = True) -> "subprocess.CompletedProcess[str]":
    """Run a command in a namespace."""
    return run("ip", "netns", "exec", name, *words, check=check)


def python(name: str, code: str, *words: str) -> list[str]:
    """Return the command line of a Python program in a namespace."""
    return ["ip", "netns", "exec", name, sys.executable, "-c", code, *words]
