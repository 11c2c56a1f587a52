"""``python -m verification.faults.keyboard ENDPOINT``: teleop in a pseudo terminal.

Reads lines from standard input. A speed above zero holds W in the fifth gear until a speed of zero.
``stall SECONDS`` stalls the terminal in both directions. Ends with teleop or with its input.
"""

import os
import select
import sys
import time

from verification.harness.teleop_terminal import STRICT, Terminal, terminal

REPEAT_S = 0.03  # of a held key
FIFTH_GEAR = "5"


def main() -> None:
    held, said = False, b""
    with terminal(sys.argv[1], *STRICT) as teleop:
        while not teleop.shows(b"ESTOP") and not teleop.ends():
            time.sleep(REPEAT_S)
        teleop.type(FIFTH_GEAR)
        while not teleop.ends():
            if select.select([sys.stdin], [], [], REPEAT_S)[0]:
                new = os.read(sys.stdin.fileno(), 4096)
                if not new:
                    return
                *lines, said = (said + new).split(b"\n")
                for line in lines:
                    held = execute(line, teleop, held)
            if held:
                teleop.type("w")


def execute(line: bytes, teleop: Terminal, held: bool) -> bool:
    """Execute a line; return whether the key is held afterwards."""
    if line.startswith(b"stall "):
        teleop.stall(float(line.removeprefix(b"stall ")))
        return held
    return float(line) > 0


if __name__ == "__main__":
    main()
