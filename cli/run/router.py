"""``t2 router``: the embedded Zenoh router alone, or its configuration for ``zenohd``."""

import argparse
import json
import os
import signal
from pathlib import Path

from cli.keys import members
from cli.keys.access import RouterSettings, access_control
from cli.run.router_probe import RouterProbe
from common import clock, log, realtime
from common.bus.session import READERS, RUNTIME_ENV, router, router_config
from common.cli_args import add_sources, sources
from common.config import load
from common.errors import ConfigError
from common.settings import BusSettings, Shared, is_encrypted
from common.systemd import Systemd
from services.ros2.config import Ros2


class RouterConfig(Shared, frozen=True, kw_only=True):
    """All sections that the router reads."""

    ros2: Ros2 = Ros2()  # for the rights of computers with ROS 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "--print", nargs="?", const="-", metavar="FILE",
        help="print the configuration for `zenohd -c`, or write it to FILE, and exit",
    )  # fmt: skip
    add_insecure(parser)
    add_sources(parser)


def add_insecure(parser: argparse.ArgumentParser) -> None:
    """Add the option that disables TLS and certificates."""
    parser.add_argument(
        "--insecure", action="append_const", dest="sets", const="bus.insecure=true", default=[],
        help="allow everyone on the network to connect and drive: no TLS, no certificates",
    )  # fmt: skip


def run(options: argparse.Namespace) -> int:
    """Route until SIGINT or SIGTERM."""
    config = load(RouterConfig, sources(options)).config
    access = access_of(config)
    if options.print:
        printed = json.dumps(router_config(config.bus, access, config.robot.id), indent=2)
        write_text(printed, options.print)
        return 0
    os.environ.setdefault(RUNTIME_ENV, READERS)  # Zenoh reads it once, on first use
    if config.host.realtime:
        realtime.request(realtime.ROUTER)
    log.configure(config.log, "router")
    if config.host.realtime and not realtime.priority():
        log.Logger().info("runs as an ordinary process: SCHED_FIFO is not granted")
    probe = RouterProbe(config.bus, config.log)
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, lambda *_: probe.stop())
    systemd = Systemd()
    with router(config.bus, access, config.robot.id):
        listen = list(config.bus.listen)
        log.Logger().info("started", listen=listen, open_to=open_to(config.bus))
        # Zenoh routes in its own threads: only an answer proves that they work.
        probe.run(lambda: systemd.ready(clock.now_ns()))
        systemd.stopping()
    return 0


def write_text(text: str, file: str) -> None:
    """Print a text, or write it to a file; raise ``ConfigError`` if it cannot be written."""
    if file == "-":
        print(text)
        return
    try:
        Path(file).write_text(f"{text}\n", encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"--print {file}: cannot be written: {error.strerror}") from None


def access_of(config: RouterConfig) -> dict[str, object] | None:
    """Return the access rules; None without a member list: all clients have full access.

    Raise ``ConfigError`` if the member list cannot be read.
    """
    bus = config.bus
    if not bus.members:
        return None
    welcome = members.read(Path(bus.members)).welcome
    return access_control(welcome, bus.onboard, RouterSettings(config.robot.id, config.ros2))


def open_to(bus: BusSettings) -> str:
    """Describe the admitted clients."""
    if bus.insecure:
        clients = "everyone on the network, without a certificate"
    elif any(map(is_encrypted, bus.listen)):
        clients = "this machine, and members with a certificate"
    else:
        clients = "every program on this machine"
    return ", and ".join((clients, *(f"clients of the router {each}" for each in bus.uplink)))
