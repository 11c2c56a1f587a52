"""``python -m bench.path.sched_fifo MODULE ...``: run a module as SCHED_FIFO, like T2."""

import runpy
import sys

from common import realtime

if __name__ == "__main__":
    realtime.request(realtime.BRIDGE)
    _, *sys.argv = sys.argv
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
