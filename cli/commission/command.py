"""``t2 checkout``: checks of a real vehicle before its first drive."""

import argparse
import shlex
import signal
import time
from collections.abc import Sequence
from pathlib import Path

from cli.commission.report import Report, Row, Verdict, render
from cli.commission.session import CheckoutSession, checkout_session
from cli.commission.steps import PHRASE, RESET_PHRASE, STEPS, Step, prompt, show
from cli.inspect.session import one_robot, robot_sources
from cli.settings import Everything
from common.cli_args import VERSION, add_sources, file_path, reader_language
from common.config import Loaded, load
from common.errors import ConfigError
from t2 import keys
from t2.errors import T2Error

NAMES = [step.name for step in STEPS]
SECTIONS = {"bridge": ("wire", "board", "vehicle", "bridge"), "safety": ("safety",)}
HEALTH_S = 3.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "--only", action="append", choices=NAMES, metavar="STEP", default=[],
        help=f"run this step only; may be repeated: {', '.join(NAMES)}",
    )  # fmt: skip
    parser.add_argument(
        "--report", type=file_path, metavar="FILE", help="out/checkout-ROBOT-DATE.md by default"
    )
    parser.add_argument("--robot", type=one_robot, help="which robot, such as 001")
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Run the steps and write the report; return 0 if all passed and the operator signed."""
    loaded = load(Everything, robot_sources(options))
    file = report_file(options.report, loaded.config.robot.id)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.default_int_handler)  # as Ctrl-C
    report = checkout(loaded, options.only)
    file.write_text(render(report), encoding="utf-8")
    outcome = "Passed" if report.passed else "NOT PASSED"
    print(f"\n{outcome}. The report: {shlex.quote(str(file))}", flush=True)
    return 0 if report.passed else 1


def checkout(loaded: Loaded[Everything], only: Sequence[str]) -> Report:
    """Run the steps on the running stack."""
    with checkout_session(loaded.config, reader_language()) as session:
        facts = [
            ("board", session.of(keys.LINK)[-1].value.board),
            ("T2 of this tool", VERSION),
            *versions(session),
        ]
        report = Report(
            robot=session.robot,
            date=now(),
            facts=facts,
            settings=settings(session),
            left_out=[name for name in NAMES if only and name not in only],
        )
        guide(report, [step for step in STEPS if step.name not in report.left_out], session)
    return report


def guide(report: Report, steps: Sequence[Step], session: CheckoutSession) -> None:
    """Run the steps with the operator; the report includes what was done before an abort."""
    show(f"Checkout of robot {report.robot}, board {dict(report.facts)['board']}.")
    name = firmware = ""
    try:
        name = prompt("Your name:")
        firmware = prompt("The firmware version, from the board's label:")
        for number, step in enumerate(steps, 1):
            show(f"\n[{number}/{len(steps)}] {step.title}\n{step.what}")
            report.steps.append((step.title, verdict(step, session)))
        show("")
        for title, found in report.steps:
            show(f"{found.outcome:8} {title}: {found.text}")
        typed = prompt(f"To sign this off, type your name ({name}):")
        report.signed = name if typed.casefold() == name.casefold() else ""
    except KeyboardInterrupt:
        report.aborted = "interrupted by the operator"
    except T2Error as error:
        report.aborted = str(error)
    report.operator = name or "unknown"
    report.facts.append(("firmware", firmware or "unknown"))
    report.ended = now()


def verdict(step: Step, session: CheckoutSession) -> Verdict:
    """Run a step until the operator accepts its verdict, or skip it with a reason."""
    if reason := choice("Press Enter to begin, or type a reason to skip:"):
        return Verdict("skipped", reason)
    while True:
        found = step.run(session)
        show(f"{found.outcome}: {found.text}")
        if found.outcome == "passed" or choice(
            "Press Enter to try again, or type any word to continue:"
        ):
            return found


def choice(question: str) -> str:
    """Return one line; a phrase that was typed too early or too late counts as Enter."""
    typed = prompt(question)
    return "" if typed.casefold() in (PHRASE, RESET_PHRASE) else typed


def now() -> str:
    """Return the local date and time."""
    return time.strftime("%Y-%m-%d %H:%M:%S %z")


def versions(session: CheckoutSession) -> list[Row]:
    """Return the version of each service that publishes health."""
    health = session.of(keys.HEALTH)
    session.until(lambda: {one.value.service for one in health} >= set(keys.ON_BOARD), HEALTH_S)
    found = {one.value.service: one.value.version for one in health}
    return [(f"T2 of {service}", version) for service, version in sorted(found.items())]


def settings(session: CheckoutSession) -> list[tuple[str, str, str]]:
    """Return path, value and origin of the services' settings that matter here."""
    return [
        (path, str(setting.value), setting.origin)
        for service, sections in SECTIONS.items()
        for path, setting in session.settings(service).items()
        if path.split(".")[0] in sections
    ]


def report_file(given: Path | None, robot: str) -> Path:
    """Return the report's path; an existing file is never overwritten."""
    file = given or Path("out") / f"checkout-{robot}-{time.strftime('%Y%m%d-%H%M%S')}.md"
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        exists = file.exists()
    except OSError as error:
        raise ConfigError(f"--report {file}: cannot be written: {error.strerror}") from None
    if exists:
        raise ConfigError(f"--report {file}: exists already; a report is not overwritten")
    return file
