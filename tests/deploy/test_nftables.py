"""``deploy/nftables/t2.nft`` on a vehicle's network of namespaces: accepted and dropped traffic."""

import os
import shutil
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from verification.harness.network_hosts import End, connect, hosts, in_network, ip, missing

RULES = Path(__file__).parents[2] / "deploy" / "nftables" / "t2.nft"
NAME = f"t2nft{os.getpid()}"
PC, CABLE, WIFI, OFFICE, BOX = (f"{NAME}{each}" for each in ("pc", "cable", "wifi", "lan", "box"))
ADDRESSES = {  # the PC's end of each network, and the others
    CABLE: ("10.7.5.220", "10.7.5.224", "10.7.5.99"),
    WIFI: ("192.168.201.1", "192.168.201.50"),
    OFFICE: ("10.0.9.1", "10.0.9.50"),
    BOX: ("172.30.0.1", "172.30.0.2"),  # of containers with published ports
}
BOARD, STRANGER = (CABLE, "10.7.5.224"), (CABLE, "10.7.5.99")
LAPTOP, IMPOSTOR = (WIFI, "192.168.201.50"), (WIFI, "10.7.5.224")
BRIDGE = (PC, "10.7.5.220")
IP_TRANSPARENT = 19  # sends from any address
# As Docker publishes `ports:`, for any destination address.
PUBLISH = (
    "add table ip nat; add chain ip nat PREROUTING { type nat hook prerouting priority dstnat; };"
    "add rule ip nat PREROUTING fib daddr type local tcp dport { 7447, 8080 } dnat to 172.30.0.2"
)


def within(host: str, *words: str) -> str:
    """Return the output of a command in a namespace."""
    return ip("netns", "exec", host, *words).stdout


@pytest.fixture(scope="module")
def network() -> Iterator[None]:
    """Connect the PC to the cable with board and stranger, to the Wi-Fi and to two more."""
    if reason := missing(NAME) or ("" if shutil.which("nft") else "nft is not installed"):
        pytest.skip(reason)
    with hosts(PC, *ADDRESSES):
        # The rules must detect spoofing, not the kernel.
        within(PC, "sysctl", "-qw", "net.ipv4.ip_forward=1", "net.ipv4.conf.all.rp_filter=0",
               "net.ipv4.conf.default.rp_filter=0")  # fmt: skip
        for number, (host, (ours, *theirs)) in enumerate(ADDRESSES.items()):
            connect(End(PC, f"net{number}", (ours,)), End(host, "eth0", tuple(theirs)))
            ip("-n", host, "route", "add", "default", "via", ours)
        yield


@contextmanager
def loaded(file: Path = RULES) -> Iterator[None]:
    """Load the rules while the context lasts."""
    within(PC, "nft", "-f", str(file))
    try:
        yield
    finally:
        within(PC, "nft", "flush", "ruleset")


def udp(host: str, address: str, port: int = 0) -> socket.socket:
    def bound() -> socket.socket:
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.setsockopt(socket.SOL_IP, IP_TRANSPARENT, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        sock.bind((address, port))
        sock.settimeout(20.0)
        return sock

    return in_network(f"/run/netns/{host}", bound)


def received(at: tuple[str, str], port: int, *senders: tuple[str, str]) -> list[tuple[str, str]]:
    """Return the senders whose datagrams arrive; the last one must be accepted."""
    with udp(*at, port) as listener:
        for index, sender in enumerate(senders):
            with udp(*sender) as sock:
                sock.sendto(bytes([index]), (at[1], port))
        found = [-1]
        while found[-1] != len(senders) - 1:
            found.append(listener.recv(1)[0])
    return [senders[index] for index in found[1:]]


def connects(server: str, client: str, address: str, port: int, timeout_s: float = 5.0) -> bool:
    """Return whether a TCP connection to a server is made."""
    listen = partial(socket.create_server, ("0.0.0.0", port))
    connect = partial(socket.create_connection, (address, port), timeout=timeout_s)
    with in_network(f"/run/netns/{server}", listen):
        try:
            in_network(f"/run/netns/{client}", connect).close()
        except TimeoutError:
            return False
    return True


@pytest.mark.usefixtures("network")
@pytest.mark.parametrize("port", [4001, 4002])
def test_only_the_board_reaches_the_bridge(port: int) -> None:
    senders = (STRANGER, LAPTOP, IMPOSTOR, BOARD)
    assert received(BRIDGE, port, *senders) == [*senders]
    with loaded():
        assert received(BRIDGE, port, *senders) == [BOARD]


@pytest.mark.usefixtures("network")
def test_the_board_reaches_no_other_port() -> None:
    with loaded():
        assert received(BRIDGE, 5000, BOARD, BRIDGE) == [BRIDGE]


@pytest.mark.usefixtures("network")
def test_the_pc_forwards_nothing_to_the_board() -> None:
    assert received(BOARD, 4002, LAPTOP, BRIDGE) == [LAPTOP, BRIDGE]
    with loaded():
        assert received(BOARD, 4002, LAPTOP, BRIDGE) == [BRIDGE]


@pytest.mark.usefixtures("network")
@pytest.mark.parametrize(
    ("server", "client", "address", "port", "accepted"),
    [
        (PC, WIFI, "192.168.201.1", 7447, True),
        (PC, WIFI, "192.168.201.1", 22, True),
        (PC, WIFI, "192.168.201.1", 8000, False),
        (PC, CABLE, "10.7.5.220", 7447, False),
        (BOX, WIFI, "192.168.201.1", 7447, True),
        (BOX, WIFI, "192.168.201.1", 8080, False),
        (BOX, OFFICE, "10.0.9.1", 7447, False),
        (BOX, OFFICE, "192.168.201.1", 7447, False),
        (BOX, CABLE, "10.7.5.220", 7447, False),
    ],
    ids=["router", "ssh", "REST", "cable"] + [
        f"container's {each}" for each in
        ("router", "dashboard", "other network", "other network, Wi-Fi's address", "cable")
    ],  # the names hold a process' number
)  # fmt: skip
def test_operators_reach_only_ssh_and_the_router(
    server: str, client: str, address: str, port: int, accepted: bool
) -> None:
    if server == BOX:
        within(PC, "nft", PUBLISH)
    assert connects(server, client, address, port)
    with loaded():
        wait_s = 5.0 if accepted else 0.2  # a dropped one arrives never
        assert connects(server, client, address, port, wait_s) == accepted


@pytest.mark.usefixtures("network")
def test_reload_beside_other_tables() -> None:
    within(PC, "nft", "add", "table", "inet", "other")
    with loaded(), loaded():
        tables = within(PC, "nft", "list", "tables").splitlines()
        assert sorted(tables) == ["table inet other", "table inet t2"]


@pytest.mark.usefixtures("network")
def test_only_the_bridges_user_may_command_the_board(tmp_path: Path) -> None:
    strict = tmp_path / "strict.nft"
    rule = "# ip daddr { $cable, 255.255.255.255, 224.0.0.0/4 } meta skuid != t2"
    text = RULES.read_text(encoding="utf-8")
    assert rule in text
    strict.write_text(text.replace(rule, rule[2:].replace("!= t2", "!= 65534")), encoding="utf-8")
    with loaded(strict), udp(*BRIDGE) as sock:
        for to in ("10.7.5.224", "10.7.5.255"):
            with pytest.raises(PermissionError):
                sock.sendto(b"root", (to, 4002))
