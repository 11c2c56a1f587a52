"""``deploy/nftables/t2.nft`` on a vehicle's network of namespaces: accepted and dropped traffic."""

import contextlib
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.deploy.network import (
    BOX,
    CABLE,
    OFFICE,
    PATIENCE_S,
    PC,
    WIFI,
    missing,
    python,
    vehicle,
    within,
)

# As Docker publishes `ports:`, for any destination address.
PUBLISH = (
    "add table ip nat; add chain ip nat PREROUTING { type nat hook prerouting priority dstnat; };"
    "add rule ip nat PREROUTING fib daddr type local tcp dport { 7447, 8080 } dnat to 172.30.0.2"
)
RULES = Path(__file__).parents[2] / "deploy" / "nftables" / "t2.nft"

# Prints each received datagram, until one holds "end".
LISTEN = """
import socket, sys
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
    sock.bind((sys.argv[1], int(sys.argv[2])))
    sock.settimeout(20)
    print("listening", flush=True)
    message = ""
    while message != "end":
        message = sock.recv(100).decode()
        print(message, flush=True)
"""
# Sends from any source address.
SEND = """
import socket, sys
source, to, port, message = sys.argv[1:]
IP_TRANSPARENT = 19
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
    sock.setsockopt(socket.SOL_IP, IP_TRANSPARENT, 1)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
    sock.bind((source, 0))
    sock.sendto(message.encode(), (to, int(port)))
"""
SERVE = """
import socket, sys
with socket.create_server(("0.0.0.0", int(sys.argv[1]))) as sock:
    print("listening", flush=True)
    sock.accept()[0].sendall(b"welcome")
    sys.stdin.read()
"""
DIAL = """
import socket, sys
try:
    with socket.create_connection((sys.argv[1], int(sys.argv[2])), timeout=1.0) as sock:
        print(sock.recv(100).decode())
except TimeoutError:
    print("no answer")
"""


@pytest.fixture(scope="module")
def network() -> Iterator[None]:
    if why_not := missing():
        pytest.skip(why_not)
    with vehicle():
        yield


@contextlib.contextmanager
def loaded(file: Path = RULES) -> Iterator[None]:
    """Load the rules while the context lasts."""
    within(PC, "nft", "-f", str(file))
    try:
        yield
    finally:
        within(PC, "nft", "flush", "ruleset")


@pytest.fixture
def rules(network: None) -> Iterator[None]:
    with loaded():
        yield


class Listener:
    """A UDP listener, until it receives \"end\"."""

    def __init__(self, name: str, address: str, port: int) -> None:
        self._to = (address, str(port))
        self._process = subprocess.Popen(
            python(name, LISTEN, *self._to), stdout=subprocess.PIPE, text=True
        )
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == "listening\n"

    def send(self, name: str, source: str, message: str) -> None:
        subprocess.run(
            python(name, SEND, source, *self._to, message), timeout=PATIENCE_S, check=True
        )

    def received(self, name: str, source: str) -> list[str]:
        """Stop it with an accepted datagram, and return the earlier ones."""
        self.send(name, source, "end")
        out, _ = self._process.communicate(timeout=PATIENCE_S)
        return out.split()[:-1]


def board_and_others(port: int) -> list[str]:
    listener = Listener(PC, "10.7.5.220", port)
    listener.send(CABLE, "10.7.5.224", "board")
    listener.send(CABLE, "10.7.5.99", "stranger")
    listener.send(WIFI, "192.168.201.50", "laptop")
    listener.send(WIFI, "10.7.5.224", "impostor")
    return listener.received(CABLE, "10.7.5.224")


def passed(counter: str) -> int:
    message = within(PC, "nft", "list", "counter", "inet", "t2", counter).stdout
    return int(message.split("packets ")[1].split()[0])


@pytest.mark.usefixtures("network")
def test_without_rules_every_host_reaches_the_bridge() -> None:
    assert sorted(board_and_others(4002)) == ["board", "impostor", "laptop", "stranger"]


@pytest.mark.usefixtures("rules")
@pytest.mark.parametrize("port", [4001, 4002])
def test_only_the_board_reaches_the_bridge(port: int) -> None:
    assert board_and_others(port) == ["board"]
    assert passed("from_board") == 2  # including the end
    assert passed("strangers") >= 2
    assert passed("spoofed") >= 1


@pytest.mark.usefixtures("rules")
def test_the_board_reaches_no_other_port() -> None:
    listener = Listener(PC, "0.0.0.0", 5000)
    listener.send(CABLE, "10.7.5.224", "board")
    ending = Listener(PC, "10.7.5.220", 4002)
    assert ending.received(CABLE, "10.7.5.224") == []
    listener._to = ("127.0.0.1", "5000")
    assert listener.received(PC, "127.0.0.1") == []


@pytest.mark.usefixtures("network")
def test_the_pc_forwards_nothing_to_the_board() -> None:
    def through() -> list[str]:
        listener = Listener(CABLE, "10.7.5.224", 4002)
        listener.send(WIFI, "192.168.201.50", "laptop")
        listener.send(PC, "10.7.5.220", "bridge")
        return listener.received(PC, "10.7.5.220")

    assert through() == ["laptop", "bridge"]
    with loaded():
        assert through() == ["bridge"]


@pytest.mark.usefixtures("rules")
@pytest.mark.parametrize(
    ("name", "address", "port", "answer"),
    [
        (WIFI, "192.168.201.1", 7447, "welcome"),
        (WIFI, "192.168.201.1", 22, "welcome"),
        (WIFI, "192.168.201.1", 8000, "no answer"),
        (CABLE, "10.7.5.220", 7447, "no answer"),
    ],
    ids=["router", "ssh", "REST", "cable"],  # the names hold a process' number
)
def test_operators_reach_only_ssh_and_the_router(
    name: str, address: str, port: int, answer: str
) -> None:
    assert answer_to(PC, name, address, port) == answer


@pytest.mark.usefixtures("network")
@pytest.mark.parametrize(
    ("name", "address", "port", "answer"),
    [
        (WIFI, "192.168.201.1", 7447, "welcome"),
        (WIFI, "192.168.201.1", 8080, "no answer"),
        (OFFICE, "10.0.9.1", 7447, "no answer"),
        (OFFICE, "192.168.201.1", 7447, "no answer"),
        (CABLE, "10.7.5.220", 7447, "no answer"),
    ],
    ids=["router", "dashboard", "another network", "the Wi-Fi's address", "cable"],
)
def test_published_container_ports_have_the_same_rules(
    name: str, address: str, port: int, answer: str
) -> None:
    within(PC, "nft", PUBLISH)
    try:
        assert answer_to(BOX, name, address, port) == "welcome"  # past `input`, and without rules
        within(PC, "nft", "-f", str(RULES))
        assert answer_to(BOX, name, address, port) == answer
    finally:
        within(PC, "nft", "flush", "ruleset")


def answer_to(server_at: str, name: str, address: str, port: int) -> str:
    """Return the answer to a TCP connection."""
    with subprocess.Popen(
        python(server_at, SERVE, str(port)),
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as server:  # fmt: skip
        try:
            assert server.stdout is not None
            assert server.stdout.readline() == "listening\n"
            done = subprocess.run(
                python(name, DIAL, address, str(port)),
                capture_output=True, text=True, timeout=PATIENCE_S, check=True,
            )  # fmt: skip
            return done.stdout.strip()
        finally:
            server.kill()


@pytest.mark.usefixtures("network")
def test_reload_beside_other_tables() -> None:
    within(PC, "nft", "add", "table", "inet", "other")
    with loaded(), loaded():
        tables = within(PC, "nft", "list", "tables").stdout.splitlines()
        assert sorted(tables) == ["table inet other", "table inet t2"]


@pytest.mark.usefixtures("network")
def test_only_the_bridges_user_may_command_the_board(tmp_path: Path) -> None:
    text = RULES.read_text(encoding="utf-8")
    strict = tmp_path / "strict.nft"
    (asleep,) = (line for line in text.splitlines() if "meta skuid != t2" in line)
    awake = asleep.replace("# ip", "ip").replace("!= t2", "!= 65534")
    strict.write_text(text.replace(asleep, awake), encoding="utf-8")
    listener = Listener(CABLE, "10.7.5.224", 4002)
    with loaded(strict):
        for to in ("10.7.5.224", "10.7.5.255"):
            sent = subprocess.run(
                python(PC, SEND, "10.7.5.220", to, "4002", "root"),
                capture_output=True, text=True, timeout=PATIENCE_S, check=False,
            )  # fmt: skip
            assert "Operation not permitted" in sent.stderr, to
    assert listener.received(PC, "10.7.5.220") == []
