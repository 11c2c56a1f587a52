"""``t2 router``: the embedded Zenoh router alone."""

import argparse
import signal
import threading

import structlog

from common import log
from common.bus.session import router
from common.config import load
from common.options import add_sources, sources
from common.settings import Shared

add_arguments = add_sources


def run(options: argparse.Namespace) -> int:
    """Route until SIGINT or SIGTERM."""
    config = load(Shared, sources(options)).config
    log.configure(config.log, "router")
    ended = threading.Event()
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, lambda *_: ended.set())
    with router(config.bus.listen, config.bus.lease):
        structlog.get_logger().info("started", listen=list(config.bus.listen))
        ended.wait()
    return 0
