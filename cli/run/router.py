"""``t2 router``: the embedded Zenoh router alone, or its configuration for ``zenohd``."""

import argparse
import json
import os
import signal
import time
from pathlib import Path

from cli.keys.access import access_control
from cli.run.router_watch import Watch
from common import log, members, realtime
from common.bus.session import READERS, READERS_ENV, router, router_config
from common.cli_args import add_sources, sources
from common.config import load
from common.errors import ConfigError
from common.settings import BusSettings, Shared, is_encrypted
from common.systemd import Systemd


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "--print", nargs="?", const="-", metavar="FILE",
        help="print the configuration for `zenohd -c`, or write it to FILE, and end",
    )  # fmt: skip
    add_insecure(parser)
    add_sources(parser)


def add_insecure(parser: argparse.ArgumentParser) -> None:
    """Add the option that opens a robot to its network."""
    parser.add_argument(
        "--insecure", action="append_const", dest="sets", const="bus.insecure=true", default=[],
        help="let everybody on the network in, to drive as well: no TLS, no certificates",
    )  # fmt: skip


def run(options: argparse.Namespace) -> int:
    """Route until SIGINT or SIGTERM."""
    config = load(Shared, sources(options)).config
    access = access_of(config.bus)
    if options.print:
        printed = json.dumps(router_config(config.bus, access, config.robot.id), indent=2)
        tell(printed, options.print)
        return 0
    os.environ.setdefault(READERS_ENV, READERS)  # Zenoh reads it once, when it is first used
    if config.robot.realtime:
        realtime.ask(realtime.ROUTER)
    log.configure(config.log, "router")
    if config.robot.realtime and not realtime.priority():
        log.Logger().info("runs as an ordinary process: SCHED_FIFO is not granted")
    watch = Watch(config.bus, config.log)
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, lambda *_: watch.stop())
    systemd = Systemd()
    with router(config.bus, access, config.robot.id):
        listen = list(config.bus.listen)
        log.Logger().info("started", listen=listen, open_to=open_to(config.bus))
        # Routing happens in Zenoh's own threads: that this one lives says nothing about them.
        watch.run(lambda: systemd.ready(time.monotonic_ns()))
        systemd.stopping()
    return 0


def tell(text: str, file: str) -> None:
    """Print a text, or write it to a file; raise ``ConfigError`` when that cannot be written."""
    if file == "-":
        print(text)
        return
    try:
        Path(file).write_text(f"{text}\n", encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"--print {file}: cannot be written: {error.strerror}") from None


def access_of(bus: BusSettings) -> dict[str, object] | None:
    """Return who may do what; None where everybody who gets in may do everything.

    Raise ``ConfigError`` when the list of members cannot be read.
    """
    if not bus.members:
        return None
    return access_control(members.read(Path(bus.members)).welcome, bus.onboard)


def open_to(bus: BusSettings) -> str:
    """Say in words who is let in."""
    if bus.insecure:
        who = "everybody on the network, without a certificate"
    elif any(map(is_encrypted, bus.listen)):
        who = "this machine, and members with a certificate"
    else:
        who = "every program on this machine"
    return ", and ".join((who, *(f"whom the router {each} lets in" for each in bus.uplink)))
