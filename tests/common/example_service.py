"""A small service, run as ``python -m tests.common.example_service KIND [options]``.

KINDs are plain, restless (never at rest), failing (once it is connected) and refused (a port).
"""

import sys

from common.service import Node, run
from common.settings import Shared
from t2 import keys
from t2.errors import LinkError
from t2.messages import Bumper


def build(node: Node[Shared]) -> None:
    """Publish the bumper, and go wrong as asked."""
    kind = sys.argv[1]
    if kind == "refused":
        raise LinkError("port 4002 is taken")
    bumper = node.bus.publisher(keys.BUMPER)

    def tick(_: int) -> None:
        bumper.put(Bumper(pressed=True))
        if kind == "failing" and node.bus.connected:
            raise RuntimeError("a bug of ours")

    node.loop.every(0.05, tick)
    node.is_stopped = lambda: kind != "restless"
    node.counters["resets"] += 1
    node.event("gamepad", "info", device="pad")


if __name__ == "__main__":
    sys.exit(run("specimen", Shared, build, sys.argv[2:]))
