"""``t2 checkout``: checks of a real vehicle before its first drive."""

import argparse
import signal
import time
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path

import msgspec

from cli.commission.bus_session import CheckoutSession, Settings
from cli.commission.operator import Check, Operator, sign, walk
from cli.commission.report import Checked, Report, Row, render
from cli.commission.steps import STEPS
from cli.commission.watchdog import BoardMaster, watchdog
from cli.settings import Everything
from common import log
from common.cli_args import VERSION, add_sources, sources
from common.config import Loaded, load
from common.errors import ConfigError, RobotError

NAMES = [step.name for step in STEPS]
SECTIONS = ("wire", "board", "vehicle", "bridge")
SERVICES = ("bridge", "safety", "odom")
HEALTH_S = 3.0
WATCHDOG = "The stack must be down, all wheels off the ground, a hand on the vehicle's switch."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "part", nargs="?", choices=["watchdog"],
        help="test the board's own command watchdog, with the stack down",
    )  # fmt: skip
    parser.add_argument(
        "--only", action="append", choices=NAMES, metavar="STEP", default=[],
        help=f"run this step only; may be repeated: {', '.join(NAMES)}",
    )  # fmt: skip
    parser.add_argument(
        "--report", type=Path, metavar="FILE", help="out/checkout-ROBOT-DATE.md by default"
    )
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Run the steps and write the report; return 0 if all passed and the operator signed."""
    loaded = load(Everything, sources(options))
    file = report_file(options, loaded.config.robot.id)
    if options.part and options.only:
        raise ConfigError("--only: the watchdog test has no steps")
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.default_int_handler)  # as Ctrl-C
    report = check_board(loaded) if options.part else check_stack(loaded, options.only)
    file.write_text(render(report), encoding="utf-8")
    print(f"\n{'Passed' if report.passed else 'NOT PASSED'}. The report: {file}", flush=True)
    return 0 if report.passed else 1


def check_stack(loaded: Loaded[Everything], only: Sequence[str]) -> Report:
    """Run the steps on the running stack."""
    log.configure(msgspec.structs.replace(loaded.config.log, level="error"), "checkout")
    operator = Operator()
    with CheckoutSession(loaded.config).opened() as session:
        settings = rows(session.settings("bridge"), SECTIONS)
        settings += rows(session.settings("safety"), ("safety",))
        board = session.log.links[-1].value.board
        draft = Report(
            robot=loaded.config.robot.id,
            date=operator.now(),
            facts=[("board", board), ("T2 of this tool", VERSION), *versions(session)],
            settings=settings,
            left_out=[name for name in NAMES if only and name not in only],
        )
        checks = [
            Check(step.name, step.title, step.what, partial(step.run, session, operator))
            for step in STEPS
            if not only or step.name in only
        ]
        return guided(draft, checks, operator)


def check_board(loaded: Loaded[Everything]) -> Report:
    """Test the board's watchdog, with the stack down."""
    config, operator = loaded.config, Operator()
    settings = {path: (one.value, one.origin) for path, one in loaded.settings.items()}
    board = f"{config.board.address}:{config.board.port}"
    with closing(BoardMaster(config)) as master:
        draft = Report(
            robot=config.robot.id,
            date=operator.now(),
            facts=[("board", board), ("T2 of this tool", VERSION)],
            settings=rows(settings, SECTIONS),
        )
        check = partial(watchdog, master, operator)
        checks = [Check("watchdog", "The board's own watchdog", WATCHDOG, check)]
        return guided(draft, checks, operator)


def guided(draft: Report, checks: Sequence[Check], operator: Operator) -> Report:
    """Run the checks with the operator; the report includes what was done before an abort."""
    operator.show(f"Checkout of robot {draft.robot}, board {dict(draft.facts)['board']}.")
    name = firmware = signed = aborted = ""
    checked: list[Checked] = []
    try:
        name = operator.prompt("Your name:")
        firmware = operator.prompt("The firmware version, from the board's label:")
        walk(checks, operator, checked)
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


def versions(session: CheckoutSession) -> list[Row]:
    """Return the version of each service that publishes health."""
    found: dict[str, str] = {}

    def complete() -> bool:
        found.update({one.value.service: one.value.version for one in session.log.health})
        return found.keys() >= {*SERVICES}

    session.until(complete, HEALTH_S)
    return [(f"T2 of {service}", version) for service, version in sorted(found.items())]


def rows(settings: Settings, sections: Iterable[str]) -> list[tuple[str, str, str]]:
    """Return path, value and origin of the settings in these sections."""
    return [
        (path, str(value), origin)
        for path, (value, origin) in settings.items()
        if path.split(".")[0] in sections
    ]


def report_file(options: argparse.Namespace, robot: str) -> Path:
    """Return the report's path; an existing file is never overwritten."""
    part = f"-{options.part}" if options.part else ""
    date = time.strftime("%Y%m%d-%H%M%S")
    file: Path = options.report or Path("out") / f"checkout-{robot}{part}-{date}.md"
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        exists = file.exists()
    except OSError as error:
        raise ConfigError(f"--report {file}: cannot be written: {error.strerror}") from None
    if exists:
        raise ConfigError(f"--report {file}: exists already; a report is not overwritten")
    return file
