"""``python -m bench.page http/HOST:PORT TOKEN picture | sight``: an operator's page.

It does over the network what the page in a browser does: it answers each snapshot with a hold, by
the picture that it has or by the snapshot, and asks for the next picture. It decodes and draws
nothing. It is a child process that also executes ``estop`` and ``go``, and counts pictures. It
imports nothing of the dashboard.
"""

import json
import statistics
import sys
import threading
import time
import urllib.request
from http.cookiejar import CookieJar
from typing import Any

from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from bench.child_process import serve

ALIVE_S = 0.09
NAME, ROBOT = "bench", "001"
HEADER_LENGTH = 2  # bytes, at the end of a picture: the length of the header before it
Message = dict[str, Any]


class Page:
    """One page: turns on the spot until it is told to stop."""

    def __init__(self, url: str, token: str, by_picture: bool) -> None:
        self._url, self._by_picture = url, by_picture
        self._jar = CookieJar()
        self._opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(self._jar))
        self._opener.open(f"{url}/?token={token}", timeout=30).read()
        self._cookie = "; ".join(f"{it.name}={it.value}" for it in self._jar)
        self._stops = False
        self._id = ""
        self._picture: Message = {}
        self._alive_s = self._asked_s = 0.0
        self._delay_s = 0.0  # of the link, by the newest answer
        self.begin()

    def begin(self) -> None:
        """Forget the pictures."""
        self.ages: list[float] = []
        self.sizes: list[int] = []
        self._began_s = time.monotonic()

    def counts(self) -> dict[str, list[float]]:
        """Return pictures a second, their median age in s and size in bytes."""
        rate = len(self.ages) / (time.monotonic() - self._began_s)
        if not self.ages:
            return {}
        sizes = statistics.median(self.sizes)
        return {"pictures": [rate], "age": [statistics.median(self.ages)], "size": [sizes]}

    def execute(self, word: str) -> None:
        """Execute ``estop`` or ``go``."""
        self._stops = word == "estop"
        if self._stops:
            threading.Thread(target=self._post_estop, daemon=True).start()
            self._send("estop", name=NAME)

    def run(self) -> None:
        """Answer what the dashboard sends."""
        address = f"{self._url.replace('http', 'ws')}/live?robot={ROBOT}"
        headers = {"Cookie": self._cookie}
        with connect(
            address, origin=Origin(self._url), additional_headers=headers, open_timeout=30
        ) as self._socket:
            for message in self._socket:
                if isinstance(message, bytes):
                    self._take(message)
                else:
                    self._handle(json.loads(message))

    _socket: ClientConnection | None = None

    def _send(self, k: str, **fields: object) -> None:
        if self._socket:
            self._socket.send(json.dumps({"k": k, **fields}))

    def _post_estop(self) -> None:
        request = urllib.request.Request(
            f"{self._url}/estop/{ROBOT}?name={NAME}", method="POST", headers={"Origin": self._url}
        )
        self._opener.open(request, timeout=30).read()

    def _handle(self, message: Message) -> None:
        now_s = time.monotonic()
        match message["k"]:
            case "hello":
                self._id = message["id"]
            case "alive":
                self._delay_s = message["age"] or 0.0
            case "slow" if message["cameras"] and not self._picture:
                self._watch()
            case "fast" if message["safety"]:
                if now_s - self._alive_s >= ALIVE_S:
                    self._alive_s = now_s
                    self._send("alive", echo=message["safety"]["heartbeat"], at=now_s)
                self._answer(message["safety"], message["driver"], now_s)

    def _answer(self, safety: Message, driver: Message, now_s: float) -> None:
        if driver["id"] != self._id:
            self._send("take", force=True, name=NAME)
        elif self._stops or driver["hold"] == "lapsed" or safety["verdict"] == "inhibited":
            self._send("free")  # safety may require that the controls are let go first
        elif safety["latched"]:
            self._send("free")
            if now_s - self._asked_s > 1.0:
                self._asked_s = now_s
                self._send("reset", echo=safety["heartbeat"], name=NAME)
        else:
            if not self._by_picture and not driver["in_sight"]:
                self._send("sight", in_sight=True, name=NAME)
            shown = self._picture.get("heartbeat") if self._by_picture else safety["heartbeat"]
            self._send("hold", echo=shown or 0, y=1.0)

    def _take(self, content: bytes) -> None:
        end = len(content) - HEADER_LENGTH
        length = int.from_bytes(content[end:], "big")
        self._picture = json.loads(content[end - length : end])
        self.sizes.append(len(content))
        if (age_s := self._picture["age"]) is not None:
            self.ages.append(age_s + self._delay_s)
        self._watch()

    def _watch(self) -> None:
        self._send("watch", camera="front")


def main() -> None:
    """Drive until standard input ends."""
    endpoint, token, mode = sys.argv[1:]
    page = Page(endpoint.replace("/", "://", 1), token, mode == "picture")
    thread = threading.Thread(target=page.run, daemon=True)
    thread.start()
    ended = threading.Event()
    serve(page.begin, page.counts, ended.set, page.execute)
    ended.wait()


if __name__ == "__main__":
    main()
