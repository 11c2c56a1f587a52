"""``python -m bench.path.ahead MODULE ...``: run a module as SCHED_FIFO, as T2 runs its own."""

import runpy
import sys

from common import realtime

if __name__ == "__main__":
    realtime.ask(realtime.BRIDGE)
    _, *sys.argv = sys.argv
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
