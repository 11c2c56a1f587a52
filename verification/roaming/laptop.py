"""``python -m verification.roaming.laptop ENDPOINT FILE alone|dashboard [SETTING]...``.

An operator's laptop: teleop without its screen, and a dashboard with a viewer.

Reads lines from standard input. A speed above zero holds W in the fifth gear until a speed of zero;
``e`` presses E. Logs the messages that it receives and sends.
"""

import contextlib
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from common import clock, keys
from common.bus.publisher import Publisher
from common.config import Sources, load
from common.freshness import NS_PER_S
from common.messages import Drive
from common.service import Node
from services.teleop.config import TeleopConfig
from services.teleop.controller import Controller
from services.teleop.event_log import EventLog
from services.teleop.hold import Press
from verification.faults.remote_host import AHEAD_S, OFFSETS, die_with_parent
from verification.roaming.message_log import MessageLog

REPEAT_S = 0.03  # of a held key
POLL_S = 0.01
FIFTH_GEAR = "5"
PORT = 8080  # of the dashboard, on its own network namespace


class Operator:
    """Presses keys and logs messages; all methods run in the loop's thread."""

    def __init__(self, node: Node[TeleopConfig], file: Path) -> None:
        self.held = False
        event_log = EventLog()
        event_log.capture_logs(node.config.log)
        self._controller = Controller(node, event_log)
        self._requests: Publisher[Drive] = next(
            one for one in node.bus.publishers if one.topic is keys.DRIVE
        )
        self._logged = 0
        self._message_log = MessageLog(
            file, node.loop, AHEAD_S * NS_PER_S if OFFSETS.exists() else 0
        )
        self._message_log.subscribe(node.bus, keys.SAFETY)
        self._message_log.subscribe(node.bus, keys.ODOMETRY)
        self._message_log.subscribe(node.bus, keys.BUMPER)
        self._press(FIFTH_GEAR, clock.now_ns())
        node.loop.every(REPEAT_S, self._hold)
        node.loop.every(POLL_S, self._log_request)

    def take(self, line: str) -> None:
        """Execute a line."""
        if line == "e":
            self._press("e", clock.now_ns())
        else:
            self.held = float(line) > 0

    def _hold(self, now_ns: int) -> None:
        self._controller.terminal.sent(0, now_ns)  # its terminal is near, and answers at once
        self._controller.terminal.answered(0, now_ns)
        if self.held:
            self._press("w", now_ns)

    def _press(self, key: str, now_ns: int) -> None:
        self._controller.press(Press(key, now_ns), now_ns)

    def _log_request(self, _: int) -> None:
        request = self._requests.last
        if request is not None and request.seq > self._logged:
            self._logged = request.seq
            self._message_log.add("requested", request, request.mono_ns, request.mono_ns)


def main() -> None:
    endpoint, file, beside, *rest = sys.argv[1:]
    sets = [f"bus.connect={endpoint}", *rest]
    node = Node("teleop", load(TeleopConfig, Sources(sets=sets)))
    operator = Operator(node, Path(file))
    node.announce()

    def read_lines() -> None:
        for line in sys.stdin:
            node.loop.post(partial(operator.take, line.strip()))
        node.loop.stop()

    threading.Thread(target=read_lines, daemon=True).start()
    node.bus.open()
    words = [word for one in sets for word in ("--set", one)]
    with contextlib.ExitStack() as stack:
        if beside == "dashboard":
            stack.enter_context(_beside("services.dashboard", *words))
            stack.enter_context(_beside("verification.roaming.viewer", str(PORT)))
        node.loop.run()
    node.bus.close()


@contextlib.contextmanager
def _beside(module: str, *words: str) -> Iterator[None]:
    """Run a module; the kernel ends it with this process."""
    with subprocess.Popen(
        [sys.executable, "-m", module, *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        preexec_fn=die_with_parent,
    ) as process:
        yield
        process.kill()


if __name__ == "__main__":
    main()
