"""``t2 checkout``: what must be checked on the real vehicle before its first drive."""

import argparse
import signal
import time
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import msgspec

from cli.commission.bus_session import Bench
from cli.commission.operator import Operator
from cli.commission.report import Checked, Report, render
from cli.commission.steps import STEPS
from cli.commission.verdict import Row
from cli.commission.walk import Stop, sign, walk
from cli.commission.watchdog import Master, watchdog
from cli.settings import Everything
from common import log
from common.cli_args import VERSION, add_sources, sources
from common.config import Loaded, load
from common.errors import ConfigError, RobotError

NAMES = [step.name for step in STEPS]
SECTIONS = ("wire", "board", "vehicle", "bridge")
HEALTH_S = 3.0

Setting = tuple[str, str, str]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "part", nargs="?", choices=["watchdog"],
        help="the trial of the board's own watchdog, with the stack down",
    )  # fmt: skip
    parser.add_argument(
        "--only", action="append", choices=NAMES, metavar="STEP", default=[],
        help=f"this step alone; may be repeated: {', '.join(NAMES)}",
    )  # fmt: skip
    parser.add_argument(
        "--report", type=Path, metavar="FILE", help="out/checkout-ROBOT-DATE.md by default"
    )
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Walk through the steps and write the report; 0 when all passed and somebody signed."""
    loaded = load(Everything, sources(options))
    file = report_file(options, loaded.config.robot.id)
    if options.part and options.only:
        raise ConfigError("--only: the watchdog's trial has no steps")
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.default_int_handler)  # ends it as ctrl-c does
    report = on_the_wire(loaded) if options.part else on_the_bus(loaded, options.only)
    file.write_text(render(report), encoding="utf-8")
    print(f"\n{'Passed' if report.passed else 'NOT PASSED'}. The report: {file}", flush=True)
    return 0 if report.passed else 1


def on_the_bus(loaded: Loaded[Everything], only: Sequence[str]) -> Report:
    """Check what the running stack shows."""
    log.configure(msgspec.structs.replace(loaded.config.log, level="error"), "checkout")
    operator = Operator()
    with Bench(loaded.config).opened() as bench:
        told = rows(bench.settings("bridge"), SECTIONS)
        told += rows(bench.settings("safety"), ("safety",))
        board = bench.tape.links[-1].value.board
        draft = Report(
            robot=loaded.config.robot.id,
            date=operator.now(),
            facts=[("board", board), ("T2 of this tool", VERSION), *versions(bench)],
            settings=told,
            left_out=[name for name in NAMES if only and name not in only],
        )
        stops = [
            Stop(step.name, step.title, step.what, partial(step.run, bench, operator))
            for step in STEPS
            if not only or step.name in only
        ]
        return led(draft, stops, operator)


def on_the_wire(loaded: Loaded[Everything]) -> Report:
    """Check the board's watchdog, with the stack down."""
    config, operator = loaded.config, Operator()
    told = {path: (one.value, one.origin) for path, one in loaded.settings.items()}
    board = f"{config.board.address}:{config.board.port}"
    with closing(Master(config)) as master:
        draft = Report(
            robot=config.robot.id,
            date=operator.now(),
            facts=[("board", board), ("T2 of this tool", VERSION)],
            settings=rows(told, SECTIONS),
        )
        what = "The stack must be down, all wheels off the ground, a hand on the vehicle's switch."
        check = partial(watchdog, master, operator)
        return led(draft, [Stop("watchdog", "The board's own watchdog", what, check)], operator)


def led(draft: Report, stops: Sequence[Stop], operator: Operator) -> Report:
    """Lead the operator through the stops; what was done before an abort is reported too."""
    operator.say(f"Checkout of robot {draft.robot}, board {dict(draft.facts)['board']}.")
    name = firmware = signed = aborted = ""
    checked: list[Checked] = []
    try:
        name = operator.ask("Your name:")
        firmware = operator.ask("The firmware, as the board's label has it (the wire tells none):")
        walk(stops, operator, checked)
        signed = sign(operator, name, checked)
    except KeyboardInterrupt:
        aborted = "interrupted by the operator"
    except RobotError as error:
        aborted = str(error)
    return replace(
        draft,
        operator=name or "unknown",
        facts=[*draft.facts, ("firmware", firmware or "unknown")],
        steps=checked,
        aborted=aborted,
        signed=signed,
        ended=operator.now(),
    )


def versions(bench: Bench) -> list[Row]:
    """Return the version of each service that is heard."""
    heard: dict[str, str] = {}

    def known() -> bool:
        heard.update({one.value.service: one.value.version for one in bench.tape.health})
        return {"bridge", "safety", "odom"} <= heard.keys()

    bench.until(known, HEALTH_S)
    return [(f"T2 of {service}", version) for service, version in sorted(heard.items())]


def rows(settings: dict[str, tuple[Any, str]], sections: Iterable[str]) -> list[Setting]:
    """Return the settings of these sections: path, value, origin."""
    return [
        (path, str(value), origin)
        for path, (value, origin) in settings.items()
        if path.split(".")[0] in sections
    ]


def report_file(options: argparse.Namespace, robot: str) -> Path:
    """Return where the report goes; a signed one is never written over."""
    part = f"-{options.part}" if options.part else ""
    date = time.strftime("%Y%m%d-%H%M%S")
    file: Path = options.report or Path("out") / f"checkout-{robot}{part}-{date}.md"
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        taken = file.exists()
    except OSError as error:
        raise ConfigError(f"--report {file}: cannot be written: {error.strerror}") from None
    if taken:
        raise ConfigError(f"--report {file}: is there already; a report is not written over")
    return file
