"""``t2 foxglove``: messages that a viewer receives over its WebSocket."""

import _thread
import json
import struct
import threading
from typing import Any

from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from common import keys
from tests.cli.inspect.conftest import buses, tool
from tests.cli.inspect.tool import Tool, pretend
from tests.common.bus_fixture import BusFixture
from tests.recorder import samples
from verification.harness.ports import free_port
from verification.harness.waiting import PATIENCE_S, wait_until

__all__ = ["buses", "tool"]

PROTOCOL = Subprotocol("foxglove.sdk.v1")
MESSAGE_DATA = 1


class Viewer(threading.Thread):
    """Subscribes to one topic as soon as it is advertised, and keeps its first message."""

    def __init__(self, port: int, topic: str) -> None:
        super().__init__(daemon=True)
        self.channel: dict[str, Any] = {}
        self.message: dict[str, Any] = {}
        self._port = port
        self._topic = topic
        self.start()

    def run(self) -> None:
        try:
            socket = wait_until(self._connected, "the server")
            assert socket is not None
            with socket:
                while not self.message:
                    printed = socket.recv(PATIENCE_S)
                    if isinstance(printed, str):
                        self._on_text(socket, json.loads(printed))
                    elif printed[0] == MESSAGE_DATA:
                        # opcode, subscription, log time
                        self.message = json.loads(printed[struct.calcsize("<BIQ") :])
        finally:
            _thread.interrupt_main()  # as Ctrl-C

    def _connected(self) -> ClientConnection | None:
        try:
            return connect(f"ws://127.0.0.1:{self._port}", subprotocols=[PROTOCOL])
        except OSError:
            return None

    def _on_text(self, socket: ClientConnection, printed: dict[str, Any]) -> None:
        for channel in printed.get("channels", []):
            if channel["topic"] == self._topic:
                self.channel = channel
                self._subscribe(socket)
        # The server advertises a channel shortly before it accepts subscriptions.
        if "Unknown channel" in printed.get("message", ""):
            self._subscribe(socket)

    def _subscribe(self, socket: ClientConnection) -> None:
        subscription = {"id": 1, "channelId": self.channel["id"]}
        socket.send(json.dumps({"op": "subscribe", "subscriptions": [subscription]}))


def test_a_viewer_receives_live_messages(buses: BusFixture, tool: Tool) -> None:
    port = free_port()
    pretend(buses, "odom", {keys.ODOMETRY: samples.odometry})
    viewer = Viewer(port, f"t2/v1/{buses.robot}/tel/odom/odometry")
    result = tool("foxglove", "--port", str(port))
    viewer.join(PATIENCE_S)
    assert (result.code, result.err) == (0, "")
    assert f"ws://127.0.0.1:{port}" in result.out
    assert (viewer.channel["schemaName"], viewer.channel["encoding"]) == ("t2.v1.Odometry", "json")
    assert "residual" in viewer.message
    assert "residual" in json.loads(viewer.channel["schema"])["properties"]
