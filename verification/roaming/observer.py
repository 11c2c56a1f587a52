"""``python -m verification.roaming.observer ENDPOINT FILE``: note the robot's own chain."""

import sys
from pathlib import Path

from common import keys
from common.bus.bus import Bus
from common.loop import Loop
from verification.harness.bus import at
from verification.roaming.notes import Notebook


def main() -> None:
    loop = Loop()
    bus = Bus(at(sys.argv[1]), "001", loop.post)
    notebook = Notebook(Path(sys.argv[2]), loop)
    notebook.listen(bus, keys.BUMPER)
    notebook.listen(bus, keys.ODOMETRY)
    notebook.listen(bus, keys.MOTION)
    bus.open()
    loop.run()


if __name__ == "__main__":
    main()
