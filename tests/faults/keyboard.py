"""``python -m tests.faults.keyboard ENDPOINT``: teleop in a terminal, a finger on its keys.

Reads speeds from standard input, one a line: while it is over zero, W is held in the fifth gear.
Ends with teleop, or with its input.
"""

import contextlib
import os
import select
import sys

from tests.teleop.terminal import terminal

REPEAT_S = 0.03  # of a held key
FIFTH_GEAR = "5"


def main() -> None:
    held, said = False, b""
    with terminal(sys.argv[1]) as teleop:
        while not teleop.shows(b"ESTOP") and not teleop.ends():
            select.select([teleop.fd], [], [], 1.0)
        teleop.type(FIFTH_GEAR)
        while not teleop.ends():
            if select.select([sys.stdin], [], [], REPEAT_S)[0]:
                new = os.read(sys.stdin.fileno(), 4096)
                if not new:
                    return
                *lines, said = (said + new).split(b"\n")
                held = float(lines[-1]) > 0 if lines else held
            if held:
                with contextlib.suppress(BlockingIOError):  # nobody reads what is typed
                    teleop.type("w")


if __name__ == "__main__":
    main()
