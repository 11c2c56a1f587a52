"""``python -m services.bridge``: the guard, with the bridge as its child."""

import sys
import time
from collections.abc import Sequence

from common import child_process, log, realtime
from common.cli_args import EXIT_CONFIG, EXIT_LINK, arguments, sources
from common.config import load
from common.drive_socket import check_router, prepare, socket_path
from common.errors import ConfigError
from common.settings import Board
from services.bridge.config import BridgeConfig
from services.bridge.guard import Guard
from services.bridge.udp import Sockets
from t2.errors import LinkError

# A bridge whose guard was killed keeps the ports until standstill.
BIND_TIMEOUT_S = 4.0


def main(argv: Sequence[str] | None = None) -> int:
    """Run the guard until a signal; return the exit code."""
    given = sys.argv[1:] if argv is None else argv
    try:
        config = load(BridgeConfig, sources(arguments("bridge").parse_args(given))).config
        check_router(config.bus)
        prepare(socket_path(config.bus, config.robot.id))  # the bridge listens there
    except ConfigError as error:
        print(f"bridge: {error}", file=sys.stderr)  # noqa: T201 - logs are not set up yet
        return EXIT_CONFIG
    if config.host.realtime:
        realtime.request(realtime.GUARD)
    # After the priority: the log's thread inherits it, and holds Python's lock at times.
    log.configure(config.log, "guard")
    if config.host.realtime:
        realtime.request(realtime.GUARD, alone=True)
        realtime.limit()
        if not realtime.priority():
            log.Logger().info("SCHED_FIFO is not granted: the bridge runs with normal priority")
    try:
        sockets = bound(config.board)
    except LinkError as error:
        log.Logger().error(str(error))
        return EXIT_LINK
    return Guard(config, sockets, child_process.command("services.bridge.bridge", *given)).run()


def bound(board: Board) -> Sockets:
    """Bind the ports; raise ``LinkError`` when they stay taken for 4 s."""
    end_s = time.monotonic() + BIND_TIMEOUT_S
    while True:
        try:
            return Sockets(board)
        except LinkError:
            if time.monotonic() > end_s:
                raise
            time.sleep(0.1)


if __name__ == "__main__":
    sys.exit(main())
