"""The whole program without a browser, on a real bus and real sockets."""

import signal
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from common import clock
from common.freshness import NS_PER_S
from tests.dashboard.bus_fixture import HOLD, Peer, drive, echo_of
from tests.dashboard.viewer import Client, connected
from verification.harness.dashboard import Server, dashboard
from verification.harness.waiting import wait_until


@pytest.fixture
def ada(server: Server, peer: Peer) -> Iterator[Client]:
    """A viewer with a state of safety."""
    peer.safe = True
    with connected(server) as it:
        while not it.next_snapshot()["safety"]:
            pass
        yield it


def test_a_hold_drives_and_letting_go_sends_three_zeros(ada: Client, peer: Peer) -> None:
    ada.take_control()
    peer.requests.clear()
    drive(ada, peer)
    assert peer.requests[0].linear == 0.0  # neutral first
    assert peer.requests[-1].linear == 0.2  # the first gear
    assert peer.requests[-1].echo > 0
    ada.send("free")
    wait_until(lambda: peer.zeros() >= 3, "zeros")
    ada.next_snapshot()
    ada.next_snapshot()
    assert peer.zeros() == 3


def test_a_browser_that_answers_nothing_ends_the_hold_until_it_lets_go(
    ada: Client, peer: Peer
) -> None:
    ada.take_control()
    peer.requests.clear()
    drive(ada, peer)
    silent_ns = clock.now_ns()  # the socket stays open, and nothing is answered
    wait_until(lambda: peer.zeros() >= 3, "zeros")
    assert clock.now_ns() - silent_ns > 0.1 * NS_PER_S
    while ada.next_snapshot()["driver"]["hold"] != "lapsed":
        pass  # earlier snapshots that are not yet read
    count = len(peer.requests)
    for _ in range(10):
        snapshot = ada.next_snapshot()
        ada.send("hold", echo=echo_of(snapshot), **HOLD)
        assert snapshot["driver"]["hold"] == "lapsed"
    assert len(peer.requests) == count
    ada.send("free")
    drive(ada, peer)


def test_a_disconnect_ends_the_hold(server: Server, peer: Peer) -> None:
    with connected(server) as it:
        it.take_control()
        peer.requests.clear()
        drive(it, peer)
    wait_until(lambda: peer.zeros() >= 3, "zeros")
    with connected(server) as it:
        assert it.next_snapshot()["driver"]["id"] is None


def test_any_viewer_may_stop_and_the_stop_is_repeated(ada: Client, peer: Peer) -> None:
    peer.estops.clear()
    ada.send("estop")
    wait_until(lambda: len(peer.estops) > 5, "stops, again and again")


def test_each_robot_has_a_page(server: Server, ada: Client) -> None:
    wait_until(lambda: "002" in ada.wait_for("slow")["robots"], "the other robot")
    with connected(server, "002") as it:
        assert it.next_snapshot()["safety"] is None
        assert it.wait_for("slow")["instances"] == {"bridge": 1}
    for query, robot in (("", "001"), ("?robot=002", "002")):
        with urllib.request.urlopen(server.url + query) as answer:
            assert f'data-robot="{robot}"' in answer.read().decode()
    with pytest.raises(urllib.error.HTTPError, match="404"):
        urllib.request.urlopen(server.url + "?robot=%22%3E%3Cscript%3E")
    with pytest.raises(InvalidStatus), connected(server, "a/b"):
        pass


def test_a_stop_of_an_unknown_robot_is_refused(server: Server, ada: Client) -> None:
    request = urllib.request.Request(
        f"{server.url}estop/made-up", method="POST", headers={"Origin": server.url.rstrip("/")}
    )
    with pytest.raises(urllib.error.HTTPError, match="404") as refused:
        urllib.request.urlopen(request)
    assert b"robot 'made-up' is unknown" in refused.value.read()
    assert "made-up" not in ada.wait_for("slow")["robots"]


@pytest.mark.parametrize(
    "text",
    [
        "{}",
        "x" * 5000,
        '{"x":' + "[" * 2000,
        '{"k":"hold","echo":1,"z":1}',
        '{"k":"hold","echo":1,"release":"sideways"}',
        '{"k":"gear","gear":6}',
    ],
)
def test_an_invalid_message_closes_the_connection(server: Server, text: str) -> None:
    with connected(server) as it:
        it.socket.send(text)
        with pytest.raises(ConnectionClosed):
            it.wait_for("never")


def test_a_signal_sends_zeros_and_ends_the_process(
    endpoint: str, peer: Peer, tmp_path: Path
) -> None:
    peer.safe = True
    with dashboard(endpoint, tmp_path) as server:
        with connected(server) as it:
            it.take_control()
            peer.requests.clear()
            drive(it, peer)
            server.process.send_signal(signal.SIGTERM)
            wait_until(lambda: peer.zeros() >= 3, "zeros")
        wait_until(lambda: server.process.poll() is not None, "its end")
        assert server.process.returncode == 0
        assert "Traceback" not in server.log.read_text()
