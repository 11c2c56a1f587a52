"""``python -m verification.faults.programs ENDPOINT NAME``: the programs beside the stack.

``driver`` and ``keyboard`` read speeds in m/s from standard input, one a line.
"""

import contextlib
import os
import select
import socket
import sys
import threading
import time
from collections.abc import Callable, Mapping

from common.bus.bus import Bus
from common.loop import Loop
from common.source import DriveSource, KeepalivePublisher, LimitPublisher
from verification.harness.bus import at
from verification.harness.teleop_terminal import STRICT, Terminal, terminal

REPEAT_S = 0.03  # of a held key
FIFTH_GEAR = "5"
PER_MS = 20  # datagrams of the flood


def driver(endpoint: str) -> None:
    """Request the last speed at 20 Hz."""
    loop = Loop()
    bus = Bus(at(endpoint), "001", loop.post)
    source = DriveSource(bus, "teleop")
    requested = [0.0]

    def read_speeds() -> None:
        for line in sys.stdin:
            requested[0] = float(line)
        loop.stop()

    threading.Thread(target=read_speeds, daemon=True).start()
    bus.open()
    loop.every(0.05, lambda _: source.request(requested[0], 0.0))
    loop.run()
    bus.close()


def keyboard(endpoint: str) -> None:
    """Run teleop in a terminal; a speed above zero holds W in the fifth gear until a zero.

    ``stall SECONDS`` stalls the terminal in both directions. Ends with teleop or with its input.
    """
    held, partial = False, b""
    with terminal(endpoint, *STRICT) as teleop:
        while not teleop.shows(b"ESTOP") and not teleop.ends():
            time.sleep(REPEAT_S)
        teleop.type(FIFTH_GEAR)
        while not teleop.ends():
            if select.select([sys.stdin], [], [], REPEAT_S)[0]:
                new = os.read(sys.stdin.fileno(), 4096)
                if not new:
                    return
                *lines, partial = (partial + new).split(b"\n")
                for line in lines:
                    held = _execute(line, teleop, held)
            if held:
                teleop.type("w")


def _execute(line: bytes, teleop: Terminal, held: bool) -> bool:
    """Execute a line; return whether the key is held afterwards."""
    if line.startswith(b"stall "):
        teleop.stall(float(line.removeprefix(b"stall ")))
        return held
    return float(line) > 0


def limiter(endpoint: str) -> None:
    """Publish a limit without a restriction at 10 Hz."""
    _publish(endpoint, lambda bus: LimitPublisher(bus, "lidar").limit)


def pendant(endpoint: str) -> None:
    """Publish the keepalive of a pendant at 10 Hz."""
    _publish(endpoint, lambda bus: KeepalivePublisher(bus, "pendant").beat)


def _publish(endpoint: str, declare: Callable[[Bus], Callable[[], object]]) -> None:
    loop = Loop()
    bus = Bus(at(endpoint), "001", loop.post)
    publish = declare(bus)
    bus.open()
    loop.every(0.1, lambda _: publish())
    loop.run()


def flood(address: str) -> None:
    """Send 20 000 datagrams/s to an address, host:port."""
    host, _, port = address.partition(":")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.connect((host, int(port)))
        due_s = time.monotonic()
        while True:
            for _ in range(PER_MS):
                with contextlib.suppress(OSError):
                    sock.send(b"GS" + bytes(20))
            due_s = max(due_s + 0.001, time.monotonic() - 0.1)
            time.sleep(max(0.0, due_s - time.monotonic()))


PROGRAMS: Mapping[str, Callable[[str], None]] = {
    program.__name__: program for program in (driver, keyboard, limiter, pendant, flood)
}

if __name__ == "__main__":
    PROGRAMS[sys.argv[2]](sys.argv[1])
