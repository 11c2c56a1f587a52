"""E-STOP from a browser while other clients abuse the dashboard's web server."""

import contextlib
import time
import urllib.request
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

from common import clock
from verification.faults.stack_fixture import StackFixture
from verification.harness.dashboard import Server, dashboard
from verification.harness.dashboard_abuse import FLOODS, flooded, half_open

HALF_OPEN = 500
SETTLE_S = 1.0  # until the abuse takes effect

Abuse = Callable[[Server], AbstractContextManager[Any]]


def flood(server: Server) -> AbstractContextManager[None]:
    """Send 50 000 messages a second, as a viewer."""
    return flooded(server, FLOODS["look"])


def unfinished(server: Server) -> AbstractContextManager[Any]:
    """Begin requests and never end them."""
    return half_open(server, HALF_OPEN)


def estop_while(abuse: Abuse) -> Callable[[StackFixture], int]:
    """Press the browser's E-STOP while a client abuses the web server."""

    def inject(fixture: StackFixture) -> int:
        with contextlib.ExitStack() as stack:
            server = stack.enter_context(dashboard(fixture.running.endpoint, fixture.folder))
            stack.enter_context(abuse(server))
            time.sleep(SETTLE_S)
            request = urllib.request.Request(
                f"{server.url}estop/001", method="POST", headers={"Origin": server.url.rstrip("/")}
            )
            at_ns = clock.now_ns()
            with urllib.request.urlopen(request, timeout=10):
                time.sleep(0.1)
        return at_ns

    return inject
