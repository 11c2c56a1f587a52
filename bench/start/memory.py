"""What each process on board holds in memory, while all of them run and the board answers."""

import contextlib
import re
import time
from pathlib import Path

from bench.start.processes import children, settings, started
from bench.start.rows import ODOM, ROUTER, SAFETY
from common.wire.commands import MotionKind
from verification.harness.fake_board import board
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

SETTLED_S = 5.0  # by then each has told its health some times
GUARD, BRIDGE = "T2, guard", "T2, bridge"


def held(settled_s: float = SETTLED_S) -> dict[str, tuple[int, int]]:
    """Return RSS and PSS of each process, in bytes."""
    with contextlib.ExitStack() as stack:
        made = stack.enter_context(board())
        given = settings(
            f"board.port={made.address[1]}",
            f"board.listen_ports={made.ports}",
            f"bus.listen=tcp/127.0.0.1:{free_port()}",
        )
        pids = {
            name: stack.enter_context(started("-m", *module, *given))[0].pid
            for name, module in (
                (ROUTER[0], ("cli", "router")),
                (GUARD, ("services.bridge",)),
                (SAFETY[0], ("services.safety",)),
                (ODOM[0], ("services.odom",)),
            )
        }
        pids[BRIDGE] = wait_until(lambda: children(pids[GUARD]), "the bridge")[0]
        made.wait_for(MotionKind.STOP)  # the bridge is there
        time.sleep(settled_s)
        return {name: of(pid) for name, pid in pids.items()}


def of(pid: int) -> tuple[int, int]:
    """Return RSS and PSS of a process, in bytes."""
    text = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii")
    rss, pss = (int(found) * 1024 for found in re.findall(r"^(?:Rss|Pss): +(\d+) kB$", text, re.M))
    return rss, pss
