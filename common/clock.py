"""The clock of all ages and time limits: nanoseconds since the host's boot, its sleep included.

``CLOCK_MONOTONIC``, the only one outside of Linux, stands still then: nothing would look stale.
"""

import time
from functools import partial

now_ns = partial(time.clock_gettime_ns, getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC))
