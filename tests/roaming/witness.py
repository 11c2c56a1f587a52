"""``python -m tests.roaming.witness ENDPOINT FILE``: notes on the robot what its own chain does."""

import sys
from pathlib import Path

from common import keys
from common.bus.bus import Bus
from common.loop import Loop
from tests.roaming.notes import Notebook
from tests.support import at


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
