"""``t2 latency``: reaction times of the bridge, hop by hop, live.

It shows a table, or with ``-o json`` a JSON line for each health message of the bridge (1 Hz). All
figures are since the bridge's start. p50 and p99 are upper bounds of histogram buckets whose bounds
differ by a third.
"""

import argparse
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING, Any

from cli.inspect import output
from cli.inspect.session import add_output, interruptible, wants_json
from common import clock, keys, log
from common.bus.bus import Arrival, Bus
from common.cli_args import add_sources, sources
from common.config import load
from common.errors import LinkError, RobotError
from common.freshness import NS_PER_S
from common.loop import Loop
from common.messages import Health, Timing
from common.settings import Shared
from services.bridge.timing import quantile

if TYPE_CHECKING:
    from rich.table import Table

PATIENCE_S = 5.0  # the bridge publishes its health once a second
SILENCE = f"no health from the bridge for {PATIENCE_S:g} s"
NAMES = {
    "board_to_bridge": "board → bridge",
    "bridge_to_break": "bridge → BRAKE",
    "bridge_to_safety": "bridge → safety",
    "driver_to_safety": "driver → safety",
    "in_safety": "safety's decision",
    "safety_to_bridge": "safety → bridge",
    "bridge_to_frame": "bridge → frame",
    "contact_to_break": "contact → BRAKE, the reflex",
    "judged_stop": "contact → BRAKE, judged",
    "request_to_frame": "request → frame",
}

# Shows the latest health, and whether the bridge is silent.
Show = Callable[[Health | None, bool], None]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("--once", action="store_true", help="show the figures once and exit")
    add_output(parser)
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Show figures until SIGINT or SIGTERM; raise ``LinkError`` if ``--once`` gets no health."""
    config = load(Shared, sources(options)).config
    log.configure(config.log, "latency")
    with (
        closing(Loop()) as loop,
        closing(Bus(config.bus, config.robot.id, loop.post)) as bus,
        shown(options.once, wants_json(options)) as show,
        interruptible(loop),
    ):
        watch = Watch(loop, show, options.once)
        bus.subscribe(keys.HEALTH, watch.on_health, service="bridge")
        loop.every(1.0, watch.check)
        bus.open()
        loop.run()
    if options.once and watch.silent:
        where = ", ".join(config.bus.endpoints)
        raise LinkError(f"no bridge at {where} within {PATIENCE_S:g} s; is `t2 up` running?")
    return 0


class Watch:
    """Shows the bridge's health, and detects when it stops."""

    def __init__(self, loop: Loop, show: Show, once: bool) -> None:
        self.newest: Health | None = None
        self._loop = loop
        self._show = show
        self._once = once
        self._received_ns = clock.now_ns()
        self.silent = False

    def on_health(self, arrival: Arrival[Health]) -> None:
        """Show a health message."""
        self.newest, self._received_ns, self.silent = arrival.message, arrival.received_ns, False
        self._show(self.newest, False)
        if self._once:
            self._loop.stop()

    def check(self, now_ns: int) -> None:
        """Show that the bridge is silent; with ``--once``, stop."""
        if self.silent or now_ns - self._received_ns < PATIENCE_S * NS_PER_S:
            return
        self.silent = True
        if self._once:
            self._loop.stop()
        else:
            self._show(self.newest, True)


@contextmanager
def shown(once: bool, as_json: bool) -> Iterator[Show]:
    """Yield the display: JSON lines, or a table that a terminal updates in place."""
    if as_json:
        yield print_line
        return
    try:
        from rich.console import Console
        from rich.live import Live
    except ImportError as error:
        raise RobotError(
            f"the table needs {error.name}: pip install -e '.[demo]', or use: t2 latency -o json"
        ) from None
    console = Console(highlight=False, markup=False)
    if once or not console.is_terminal:
        yield lambda newest, silent: console.print(table(newest, silent))
        return
    with Live(table(None, False), console=console, auto_refresh=False) as live:
        yield lambda newest, silent: live.update(table(newest, silent), refresh=True)


def print_line(newest: Health | None, silent: bool) -> None:
    """Print a JSON line; report silence on standard error."""
    if silent:
        output.warn(f"t2 latency: {SILENCE}")
    elif newest:
        output.line(figures(newest))


def figures(health: Health) -> dict[str, Any]:
    """Return the figures of a health message; durations in seconds, None if there are none."""
    timing = health.timing or Timing(bounds=(), durations={}, not_counted={})
    return {
        "t_ns": health.t_ns,
        "boot": health.boot,
        "uptime": health.uptime,
        "durations": {
            name: {
                "count": sum(each.counts),
                "p50": quantile(timing.bounds, each, 0.5),
                "p99": quantile(timing.bounds, each, 0.99),
                "worst": each.worst if any(each.counts) else None,
            }
            for name, each in timing.durations.items()
        },
        "not_counted": timing.not_counted,
    }


def table(newest: Health | None, silent: bool) -> "Table":
    """Return a table in milliseconds, with the hops below their reaction."""
    from rich.table import Table

    made = Table(title="Reactions in ms", title_justify="left", caption_justify="left")
    made.add_column("since the bridge's start")
    for title in ("count", "p50 ≤", "p99 ≤", "worst"):
        made.add_column(title, justify="right")
    made.caption = SILENCE if silent else "waiting for the bridge"
    if newest is None:
        return made
    shown_figures = figures(newest)
    for name, each in shown_figures["durations"].items():
        whole, _, hop = name.partition(".")
        text = f"  {NAMES.get(hop, hop)}" if hop else NAMES.get(whole, whole)
        values = (each[key] for key in ("p50", "p99", "worst"))
        times = ("" if value is None else f"{value * 1000:.3f}" for value in values)
        made.add_row(text, str(each["count"]), *times, style="" if hop else "bold")
    if not silent:
        left_out = ", ".join(
            f"{count} {name}" for name, count in shown_figures["not_counted"].items()
        )
        made.caption = (
            f"up for {shown_figures['uptime']:.0f} s; not counted: {left_out or 'nothing'}"
        )
    return made
