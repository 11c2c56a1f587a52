"""``python -m verification.faults.third_party limiter ENDPOINT``: a limit source, to be killed."""

import sys

from common.bus.bus import Bus
from common.loop import Loop
from common.source import LimitPublisher
from verification.harness.bus import at

LIMIT_LEASE_S = 0.5
PARTIES = ("limiter",)
PERIOD_S = 0.1
SETS = [f'safety.limits.lidar={{lease = {LIMIT_LEASE_S}, silence = "stop"}}']


def main() -> None:
    loop = Loop()
    bus = Bus(at(sys.argv[2]), "001", loop.post)
    limits = LimitPublisher(bus, "lidar")
    bus.open()

    def publish(_: int) -> None:
        limits.limit()

    loop.every(PERIOD_S, publish)
    loop.run()


if __name__ == "__main__":
    main()
