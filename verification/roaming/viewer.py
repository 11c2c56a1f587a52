"""``python -m verification.roaming.viewer PORT``: view the dashboard's robot."""

import contextlib
import json
import sys
import time

from websockets.exceptions import WebSocketException
from websockets.sync.client import connect
from websockets.typing import Origin

AGAIN_S = 0.5


def main() -> None:
    address = f"127.0.0.1:{sys.argv[1]}"
    while True:
        with (
            contextlib.suppress(OSError, WebSocketException),
            connect(f"ws://{address}/live", origin=Origin(f"http://{address}")) as socket,
        ):
            socket.send(json.dumps({"k": "look", "robot": "001"}))
            for _ in socket:
                pass
        time.sleep(AGAIN_S)


if __name__ == "__main__":
    main()
