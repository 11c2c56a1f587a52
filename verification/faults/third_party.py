"""``python -m verification.faults.third_party NAME ENDPOINT``: a limit source, or a pendant."""

import sys

from common.bus.bus import Bus
from common.loop import Loop
from common.source import KeepalivePublisher, LimitPublisher
from verification.harness.bus import at

LIMIT_LEASE_S = 0.5
PARTIES = ("limiter", "pendant")
PERIOD_S = 0.1
SETS = [
    f'safety.limits.lidar={{lease = {LIMIT_LEASE_S}, silence = "stop"}}',
    'safety.estop_keepalive=["pendant"]',
]


def main() -> None:
    loop = Loop()
    bus = Bus(at(sys.argv[2]), "001", loop.post)
    is_limiter = sys.argv[1] == "limiter"
    source = LimitPublisher(bus, "lidar") if is_limiter else KeepalivePublisher(bus, "pendant")
    bus.open()

    def publish(_: int) -> None:
        if isinstance(source, LimitPublisher):
            source.limit()
        else:
            source.beat()

    loop.every(PERIOD_S, publish)
    loop.run()


if __name__ == "__main__":
    main()
