"""The whole program without a browser, on a real bus and real sockets."""

import signal
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed

from common import clock
from common.freshness import NS_PER_S
from services.dashboard.fleet import ROBOTS_MAX
from tests.dashboard.bus_fixture import HOLD, Peer, drive
from verification.harness.dashboard import Client, Server, connected, dashboard
from verification.harness.waiting import wait_until


@pytest.fixture
def ada(server: Server, peer: Peer) -> Iterator[Client]:
    """A viewer with a state of safety."""
    peer.safe = True
    with connected(server) as it:
        while not it.next_snapshot()["safety"]:
            pass
        yield it


def test_a_hold_drives_and_a_release_sends_three_zeros(ada: Client, peer: Peer) -> None:
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


def test_a_missed_round_trip_ends_the_hold_until_a_release(ada: Client, peer: Peer) -> None:
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
        ada.send("hold", n=snapshot["n"], **HOLD)
        assert snapshot["driver"]["hold"] == "lapsed"
    assert len(peer.requests) == count
    ada.send("free")
    drive(ada, peer)


def test_an_answer_to_an_old_snapshot_does_not_drive(ada: Client, peer: Peer) -> None:
    ada.take_control()
    ada.send("free")
    first = ada.next_snapshot()["n"]
    for _ in range(12):
        ada.next_snapshot()
    peer.requests.clear()
    ada.send("hold", n=first, **HOLD)
    for _ in range(4):
        assert ada.next_snapshot()["driver"]["hold"] == "free"
    assert peer.requests == []


def test_a_disconnect_ends_the_hold(server: Server, peer: Peer) -> None:
    with connected(server) as it:
        it.take_control()
        peer.requests.clear()
        drive(it, peer)
    wait_until(lambda: peer.zeros() >= 3, "zeros")
    with connected(server) as it:
        assert it.next_snapshot()["driver"]["id"] is None


def test_a_silent_safety_ends_the_hold(ada: Client, peer: Peer) -> None:
    ada.take_control()
    peer.requests.clear()
    drive(ada, peer)
    peer.safe = False
    while (snapshot := ada.next_snapshot())["driver"]["hold"] != "lapsed":
        ada.send("hold", n=snapshot["n"], **HOLD)
    assert snapshot["safety"] is None
    wait_until(lambda: peer.zeros() >= 3, "zeros")


def test_one_viewer_drives_and_a_takeover_asks(server: Server, ada: Client, peer: Peer) -> None:
    ada.take_control()
    ada.send("look", robot="001", name="Ada")
    with connected(server) as bob:
        bob.send("take")
        assert bob.wait_for("taken")["by"] == "Ada"
        snapshot = bob.next_snapshot()
        assert snapshot["driver"]["name"] == "Ada"
        peer.requests.clear()
        bob.send("hold", n=snapshot["n"], **HOLD)
        bob.send("reset")
        assert bob.wait_for("notice")["text"] == "take_first"
        assert peer.requests == []
        bob.take_control(force=True)
        assert ada.wait_for("notice")["text"] == "taken_over"


def test_any_viewer_may_stop_and_the_stop_is_repeated(ada: Client, peer: Peer) -> None:
    peer.estops.clear()
    ada.send("estop")
    wait_until(lambda: len(peer.estops) > 5, "stops, again and again")


def test_a_stop_by_post_needs_no_websocket(server: Server, peer: Peer) -> None:
    peer.estops.clear()
    post_stop(server, "001")
    wait_until(lambda: peer.estops, "a stop")


def post_stop(server: Server, robot: str) -> None:
    """Stop a robot by POST."""
    request = urllib.request.Request(
        f"{server.url}estop/{robot}", method="POST", headers={"Origin": server.url.rstrip("/")}
    )
    with urllib.request.urlopen(request) as answer:
        assert answer.status == 200


def test_a_refusal_is_reported(ada: Client) -> None:
    ada.take_control()
    ada.send("reset", n=ada.next_snapshot()["n"])
    assert "safety does not answer" in ada.wait_for("notice")["text"]


def test_several_robots(server: Server, ada: Client) -> None:
    wait_until(lambda: "002" in ada.wait_for("slow")["robots"], "the other robot")
    assert "two words" not in ada.received["slow"]["robots"]
    with connected(server, "002") as it:
        assert it.next_snapshot()["safety"] is None
        assert [one["name"] for one in it.wait_for("slow")["services"]] == ["bridge"]
    ada.send("look", robot="003")
    assert ada.wait_for("hello")["robot"] == "003"


def test_the_number_of_robots_is_limited_except_for_a_stop(server: Server, peer: Peer) -> None:
    with connected(server) as it:
        for number in range(ROBOTS_MAX + 1):
            it.send("look", robot=f"many-{number}")
        assert it.wait_for("notice")["text"] == "too_many_robots"
    peer.stops_elsewhere.clear()
    post_stop(server, "one-more")
    wait_until(lambda: peer.stops_elsewhere, "a stop of one more")


def test_an_invalid_robot_name_is_refused(server: Server) -> None:
    request = urllib.request.Request(
        f"{server.url}estop/*", method="POST", headers={"Origin": server.url.rstrip("/")}
    )
    with pytest.raises(urllib.error.HTTPError, match="404"):
        urllib.request.urlopen(request)


def test_a_stop_of_an_unknown_robot_is_refused(server: Server, ada: Client) -> None:
    request = urllib.request.Request(
        f"{server.url}estop/made-up", method="POST", headers={"Origin": server.url.rstrip("/")}
    )
    with pytest.raises(urllib.error.HTTPError, match="404") as refused:
        urllib.request.urlopen(request)
    assert b"robot 'made-up' is unknown" in refused.value.read()
    ada.send("estop", robot="made-up")
    assert ada.wait_for("notice")["text"] == "estop_unknown"
    assert "made-up" not in ada.wait_for("slow")["robots"]


@pytest.mark.parametrize("text", ["", "{}", '{"k":"hold"}', "x" * 5000, '{"x":' + "[" * 2000])
def test_an_invalid_message_closes_the_connection(server: Server, text: str) -> None:
    with connected(server) as it:
        it.socket.send(text)
        with pytest.raises(ConnectionClosed):
            it.wait_for("never")


def test_the_dashboard_is_alive_on_the_bus(peer: Peer) -> None:
    wait_until(lambda: peer.alive, "presence")


def test_a_signal_sends_zeros_and_ends_the_process(
    endpoint: str, peer: Peer, tmp_path: Path
) -> None:
    peer.safe = True
    with dashboard(endpoint, tmp_path, "dashboard.round_trip=1.0") as server:
        with connected(server) as it:
            it.take_control()
            peer.requests.clear()
            drive(it, peer)
            server.process.send_signal(signal.SIGTERM)
            wait_until(lambda: peer.zeros() >= 3, "zeros")
        wait_until(lambda: server.process.poll() is not None, "its end")
        assert server.process.returncode == 0
        assert "Traceback" not in server.log.read_text()
