"""``python -m verification.roaming.observer ENDPOINT FILE``: log the robot's control chain."""

import sys
from pathlib import Path

from common import keys
from common.bus.bus import Bus
from common.loop import Loop
from verification.harness.bus import at
from verification.roaming.message_log import MessageLog


def main() -> None:
    loop = Loop()
    bus = Bus(at(sys.argv[1]), "001", loop.post)
    message_log = MessageLog(Path(sys.argv[2]), loop)
    message_log.subscribe(bus, keys.BUMPER)
    message_log.subscribe(bus, keys.ODOMETRY)
    message_log.subscribe(bus, keys.MOTION)
    bus.open()
    loop.run()


if __name__ == "__main__":
    main()
