"""``t2 foxglove``: messages that a viewer receives over its WebSocket."""

import json
import signal
import struct
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from t2 import keys
from tests.cli.inspect.conftest import buses
from tests.cli.inspect.tool import pretend
from tests.cli.processes import PATIENCE_S, running, sets, t2
from tests.common.bus_fixture import BusFixture
from tests.recorder import samples
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

__all__ = ["buses"]

PROTOCOL = Subprotocol("foxglove.sdk.v1")
HEAD = struct.calcsize("<BIQ")  # opcode, subscription, log time
MESSAGE_DATA = 1


def connected(port: int) -> ClientConnection | None:
    try:
        return connect(f"ws://127.0.0.1:{port}", subprotocols=[PROTOCOL])
    except OSError:
        return None


def first_of(topic: str, socket: ClientConnection) -> tuple[dict[str, Any], dict[str, Any]]:
    """Subscribe to a topic once it is advertised; return its channel and first message."""
    channel: dict[str, Any] = {}
    while True:
        received = socket.recv(PATIENCE_S)
        if not isinstance(received, str):
            if received[0] == MESSAGE_DATA:
                return channel, json.loads(received[HEAD:])
            continue
        text = json.loads(received)
        advertised = [each for each in text.get("channels", []) if each["topic"] == topic]
        # The server advertises a channel shortly before it accepts subscriptions.
        if advertised or "Unknown channel" in text.get("message", ""):
            channel = advertised[0] if advertised else channel
            wanted = [{"id": 1, "channelId": channel["id"]}]
            socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))


def test_a_viewer_receives_live_messages(buses: BusFixture, tmp_path: Path) -> None:
    port = free_port()
    pretend(buses, "odom", {keys.ODOMETRY: samples.odometry})
    words = ["--port", str(port), "--robot", buses.robot, *sets(f"bus.connect={buses.endpoint}")]
    with running(t2("foxglove", *words), tmp_path / "log") as server:
        socket = wait_until(lambda: connected(port), "the server", PATIENCE_S)
        assert socket is not None
        with socket:
            channel, message = first_of(f"t2/v1/{buses.robot}/tel/odom/odometry", socket)
        server.send_signal(signal.SIGINT)
        assert server.wait(PATIENCE_S) == 0
    assert f"ws://127.0.0.1:{port}" in (tmp_path / "log").read_text()
    assert (channel["schemaName"], channel["encoding"]) == ("t2.v1.Odometry", "json")
    assert "residual" in message
    assert "residual" in json.loads(channel["schema"])["properties"]
