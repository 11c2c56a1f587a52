"""``python -m verification.faults.driver ENDPOINT``: a motion source that can be killed.

Reads speeds in m/s from standard input, one a line, and requests the last one at 20 Hz.
"""

import sys
import threading

from common.bus.bus import Bus
from common.loop import Loop
from common.source import DriveSource
from verification.harness.bus import at


def main() -> None:
    loop = Loop()
    bus = Bus(at(sys.argv[1]), "001", loop.post)
    source = DriveSource(bus, "teleop")
    requested = [0.0]

    def read_speeds() -> None:
        for line in sys.stdin:
            requested[0] = float(line)
        loop.stop()

    threading.Thread(target=read_speeds, daemon=True).start()
    bus.open()

    def send_request(_: int) -> None:
        source.request(requested[0], 0.0)

    loop.every(0.05, send_request)
    loop.run()
    bus.close()


if __name__ == "__main__":
    main()
