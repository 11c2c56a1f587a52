"""``python -m verification.faults.driver ENDPOINT``: a held stick, as a process that can be killed.

Reads speeds in m/s from standard input, one a line, and asks for the last one at 20 Hz.
"""

import sys
import threading

from common.bus.bus import Bus
from common.loop import Loop
from common.source import DriveSource
from verification.harness.support import at


def main() -> None:
    loop = Loop()
    bus = Bus(at(sys.argv[1]), "001", loop.post)
    source = DriveSource(bus, "teleop")
    asked = [0.0]

    def listen() -> None:
        for line in sys.stdin:
            asked[0] = float(line)
        loop.stop()

    threading.Thread(target=listen, daemon=True).start()
    bus.open()

    def ask(_: int) -> None:
        source.ask(asked[0], 0.0)

    loop.every(0.05, ask)
    loop.run()
    bus.close()


if __name__ == "__main__":
    main()
