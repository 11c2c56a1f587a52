"""``t2 checkout``: checks of a real vehicle before its first drive."""

import argparse
import signal
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from pathlib import Path

import msgspec

from cli.commission import stop_command
from cli.commission.bus_session import CheckoutSession
from cli.commission.operator import S, Step, prompt, show, sign, walk
from cli.commission.report import Report, Row, render
from cli.commission.steps import STEPS
from cli.commission.watchdog import WATCHDOG, BoardMaster
from cli.inspect.session import add_output
from cli.settings import Everything
from common import log
from common.cli_args import VERSION, add_sources, sources
from common.config import Loaded, Setting, load
from common.errors import ConfigError, RobotError

NAMES = [step.name for step in STEPS]
SECTIONS = ("wire", "board", "vehicle", "bridge")
SERVICES = ("bridge", "safety", "odom")
HEALTH_S = 3.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "part", nargs="?", choices=["watchdog", "stop"],
        help="watchdog: test the board's own command watchdog, with the stack down; "
        "stop: fit safety's settings to the stops in recordings",
    )  # fmt: skip
    parser.add_argument(
        "files",
        metavar="RECORDING",
        type=Path,
        nargs="*",
        help="recordings (.mcap), directly after `stop`",
    )
    parser.add_argument(
        "--only", action="append", choices=NAMES, metavar="STEP", default=[],
        help=f"run this step only; may be repeated: {', '.join(NAMES)}",
    )  # fmt: skip
    parser.add_argument(
        "--report", type=Path, metavar="FILE", help="out/checkout-ROBOT-DATE.md by default"
    )
    add_output(parser)
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Run the steps and write the report; return 0 if all passed and the operator signed."""
    loaded = load(Everything, sources(options))
    check_options(options)
    if options.part == "stop":
        return stop_command.run(options, loaded.config)
    file = report_file(options, loaded.config.robot.id)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.default_int_handler)  # as Ctrl-C
    report = check_board(loaded) if options.part else check_stack(loaded, options.only)
    file.write_text(render(report), encoding="utf-8")
    print(f"\n{'Passed' if report.passed else 'NOT PASSED'}. The report: {file}", flush=True)
    return 0 if report.passed else 1


def check_options(options: argparse.Namespace) -> None:
    """Refuse options that do not belong to the requested part."""
    if options.part and options.only:
        raise ConfigError(f"--only: the {options.part} test has no steps")
    if options.part == "stop" and options.report:
        raise ConfigError("--report: the stop test writes no report; -o json prints its result")
    if options.part != "stop" and options.files:
        raise ConfigError(f"{options.files[0]}: only `t2 checkout stop` reads recordings")
    if options.part != "stop" and options.output != "text":
        raise ConfigError("-o: only `t2 checkout stop` has other formats than text")


def check_stack(loaded: Loaded[Everything], only: Sequence[str]) -> Report:
    """Run the steps on the running stack."""
    log.configure(msgspec.structs.replace(loaded.config.log, level="error"), "checkout")
    with CheckoutSession(loaded.config).opened() as session:
        settings = rows(session.settings("bridge"), SECTIONS)
        settings += rows(session.settings("safety"), ("safety",))
        report = started(loaded, session.log.links[-1].value.board, settings)
        report.facts += versions(session)
        report.left_out = [name for name in NAMES if only and name not in only]
        guide(report, [step for step in STEPS if step.name not in report.left_out], session)
    return report


def check_board(loaded: Loaded[Everything]) -> Report:
    """Test the board's watchdog, with the stack down."""
    board = f"{loaded.config.board.address}:{loaded.config.board.port}"
    report = started(loaded, board, rows(loaded.settings, SECTIONS))
    with closing(BoardMaster(loaded.config)) as master:
        guide(report, [WATCHDOG], master)
    return report


def started(
    loaded: Loaded[Everything], board: str, settings: Sequence[tuple[str, str, str]]
) -> Report:
    """Return the report of a checkout that begins now."""
    facts = [("board", board), ("T2 of this tool", VERSION)]
    return Report(robot=loaded.config.robot.id, date=now(), facts=facts, settings=settings)


def guide(report: Report, steps: Sequence[Step[S]], subject: S) -> None:
    """Run the steps with the operator; the report includes what was done before an abort."""
    show(f"Checkout of robot {report.robot}, board {dict(report.facts)['board']}.")
    name = firmware = ""
    try:
        name = prompt("Your name:")
        firmware = prompt("The firmware version, from the board's label:")
        walk(steps, subject, report.steps)
        report.signed = sign(name, report.steps)
    except KeyboardInterrupt:
        report.aborted = "interrupted by the operator"
    except RobotError as error:
        report.aborted = str(error)
    report.operator = name or "unknown"
    report.facts.append(("firmware", firmware or "unknown"))
    report.ended = now()


def now() -> str:
    """Return the local date and time."""
    return time.strftime("%Y-%m-%d %H:%M:%S %z")


def versions(session: CheckoutSession) -> list[Row]:
    """Return the version of each service that publishes health."""
    found: dict[str, str] = {}

    def complete() -> bool:
        found.update({one.value.service: one.value.version for one in session.log.health})
        return found.keys() >= {*SERVICES}

    session.until(complete, HEALTH_S)
    return [(f"T2 of {service}", version) for service, version in sorted(found.items())]


def rows(settings: Mapping[str, Setting], sections: Iterable[str]) -> list[tuple[str, str, str]]:
    """Return path, value and origin of the settings in these sections."""
    return [
        (path, str(setting.value), setting.origin)
        for path, setting in settings.items()
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
