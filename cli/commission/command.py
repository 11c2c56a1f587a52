"""``t2 checkout``: checks of a real vehicle before its first drive."""

import argparse
import math
import shlex
import signal
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from cli.commission.board_link import Times, check_alone, measure_watchdog
from cli.commission.drive_command import guided_drive
from cli.commission.manoeuvres import GROUPS
from cli.commission.report import Report, Row, Verdict, after, parse, render
from cli.commission.session import CheckoutSession, checkout_session
from cli.commission.steps import STEPS, Step, choice, prompt, show
from cli.commission.texts import ENGLISH, Say
from cli.inspect.output import padded
from cli.inspect.session import one_robot, positive, robot_sources
from cli.settings import Everything
from common.cli_args import VERSION, add_sources, file_path, reader_language
from common.config import Loaded, Setting, load
from common.errors import ConfigError
from t2 import keys
from t2.errors import T2Error
from t2.text_file import read_text

NAMES = [step.name for step in STEPS]
UNSET = ("sonar",)  # steps whose result depends on no setting
SECTIONS = {"bridge": ("wire", "board", "vehicle", "bridge"), "safety": ("safety",)}
HEALTH_S = 3.0
Work = Callable[[Report, CheckoutSession], None]  # fills in the report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "part",
        nargs="?",
        choices=["drive", "watchdog"],
        help="drive: manoeuvres on the ground, for a recording; watchdog: wheels off the ground, "
        "without the stack, whether the board stops by itself when commands end",
    )
    parser.add_argument(
        "--only", action="append", choices=[*NAMES, *GROUPS], metavar="STEP", default=[],
        help=f"run this step only; may be repeated: {', '.join(NAMES)}; of drive: "
        f"{', '.join(GROUPS)}",
    )  # fmt: skip
    parser.add_argument(
        "--space", type=positive, metavar="M",
        help="drive: leave out what needs more than M metres ahead or behind",
    )  # fmt: skip
    parser.add_argument(
        "--resume", type=file_path, metavar="REPORT",
        help="take over the steps that passed in an earlier report, and run the others",
    )  # fmt: skip
    parser.add_argument(
        "--report", type=file_path, metavar="FILE", help="out/checkout-ROBOT-DATE.md by default"
    )
    parser.add_argument("--robot", type=one_robot, help="which robot, such as 001")
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Run the checks and write the report; return 0 if all passed and the operator signed."""
    loaded = load(Everything, robot_sources(options))
    check(options)
    before = earlier(options.resume, loaded.config.robot.id) if options.resume else None
    file = report_file(options.report, loaded.config.robot.id)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.default_int_handler)  # as Ctrl-C
    work = partial(guided_drive, only=options.only, space_m=options.space or math.inf)
    if options.part is None:
        work = partial(run_steps, only=options.only, before=before)
    try:
        alone = options.part == "watchdog"
        report = watchdog(loaded, Times()) if alone else checkout(loaded, work)
    except BaseException:
        file.unlink(missing_ok=True)  # it is empty
        raise
    write(file, render(report))
    say = Say(report.language)
    outcome = say("all_passed" if report.passed else "not_passed")
    print(f"\n{say('outcome', outcome=outcome, file=shlex.quote(str(file)))}", flush=True)
    return 0 if report.passed else 1


def check(options: argparse.Namespace) -> None:
    """Refuse options of another part with ``ConfigError``."""
    if options.part != "drive" and options.space:
        raise ConfigError("--space: is an option of `t2 checkout drive`")
    if options.part and options.resume:
        raise ConfigError(f"--resume: is no option of `t2 checkout {options.part}`")
    if options.part == "watchdog" and options.only:
        raise ConfigError("--only: is no option of `t2 checkout watchdog`")
    names: Sequence[str] = GROUPS if options.part == "drive" else NAMES
    for name in options.only:
        if name not in names:
            raise ConfigError(f"--only {name}: allowed are {', '.join(names)}")


def checkout(loaded: Loaded[Everything], work: Work) -> Report:
    """Do the work on the running stack, and return its report."""
    with checkout_session(loaded.config, reader_language()) as session:
        facts = [
            ("board", session.of(keys.LINK)[-1].value.board),
            ("T2 of this tool", VERSION),
            *versions(session),
        ]
        report = Report(
            robot=session.robot, date=now(), facts=facts, settings=settings(session),
            language=session.language,
        )  # fmt: skip
        guide(report, partial(work, report, session))
    return report


def watchdog(loaded: Loaded[Everything], times: Times) -> Report:
    """Measure the board's own watchdog without the stack, and return the report."""
    config = loaded.config
    check_alone(config)
    board = f"{config.board.address}:{config.board.port}"
    report = Report(
        robot=config.robot.id,
        date=now(),
        facts=[("board", board), ("T2 of this tool", VERSION)],
        settings=of_sections(loaded.settings, ("board", "wire")),
        language=reader_language(),
    )
    guide(report, partial(measure_watchdog, report, config, times))
    return report


def guide(report: Report, work: Callable[[], None]) -> None:
    """Do the work with the operator; the report includes what was done before an abort."""
    say = Say(report.language)
    show(say("title", robot=report.robot, board=dict(report.facts)["board"]))
    report.operator = "unknown"
    try:
        while not (name := prompt(say("your_name"))):
            pass
        report.operator = name
        firmware = prompt(say("firmware"))
        report.facts.append(("firmware", firmware or say("unknown")))
        work()
        show("")
        others = [each for each in report.manoeuvres if each[1].outcome != "passed"]
        if report.manoeuvres:
            count = len(report.manoeuvres)
            show(say("done", done=count - len(others), all=count))
        for title, found in (*report.steps, *others):
            show(f"{padded(say(f'verdict.{found.outcome}'), 8)} {title}: {found.finding}")
        if report.missing:
            show(say("missing", titles=tuple(report.missing)))
        report.signed = signature(name, say)
    except KeyboardInterrupt:
        report.aborted = report.aborted or say("interrupted")
    except T2Error as error:
        report.aborted = str(error)
        show(f"\n{say('ended', reason=str(error))}")
    report.ended = now()


def signature(name: str, say: Say = ENGLISH) -> str:
    """Return the operator's name, once it is typed; empty if the report is left unsigned."""
    question = say("sign", name=name)
    while typed := prompt(question):
        if typed.casefold() == name.casefold():
            return name
        question = say("sign_again", name=name)
    return ""


def run_steps(
    report: Report, session: CheckoutSession, only: Sequence[str], before: Report | None = None
) -> None:
    """Run the steps with the wheels off the ground, or only these; not those passed ``before``."""
    say = Say(report.language)
    steps = [step for step in STEPS if not only or step.name in only]
    report.left_out = [say.of(step.title) for step in STEPS if step not in steps]
    report.planned = [say.of(step.title) for step in steps]
    known = taken_over(before, report, steps) if before else {}
    for number, step in enumerate(steps, 1):
        title = say.of(step.title)
        show(f"\n[{number}/{len(steps)}] {title}")
        if title in known:
            show(say("found", outcome=say("verdict.passed"), text=known[title].finding))
        else:
            show(say.of(step.what))
        note = partial(_note, report.steps, number, title)
        note(known.get(title) or verdict(step, session, note, say))


def _note(steps: list[tuple[str, Verdict]], number: int, title: str, found: Verdict) -> None:
    """Set the verdict of the step with this number; the report has it after an early end, too."""
    steps[number - 1 :] = [(title, found)]


def earlier(file: Path, robot: str) -> Report:
    """Return the report in a file, which is of this robot."""
    try:
        found = parse(read_text(file))
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise ConfigError(f"--resume {file}: cannot be read: {reason}") from None
    if found is None or not found.steps:
        raise ConfigError(
            f"--resume {file}: is no whole report of the steps, of this version of T2: its last "
            "line has what is taken over; without --resume all steps are run"
        )
    if found.robot != robot:
        raise ConfigError(f"--resume {file}: is of robot {found.robot}, not of {robot}")
    if found.language != reader_language():
        raise ConfigError(f"--resume {file}: has another language; use T2_LANG={found.language}")
    return found


def taken_over(before: Report, now: Report, steps: Sequence[Step]) -> dict[str, Verdict]:
    """Return those of these steps that passed before, by title, with their date and operator.

    After a change of board, firmware or versions none counts, after one of settings those that
    depend on none.
    """
    facts = [
        f"{name} is now {value}" for name, value in now.facts if (name, value) not in before.facts
    ]
    settings = {row[:2] for row in before.settings} ^ {row[:2] for row in now.settings}
    changed = [*facts, *sorted({path for path, _ in settings})]
    if changed:
        now.facts.append((Say(now.language)("figure.changed"), ", ".join(changed)))
        show(Say(now.language)("changed", what=tuple(changed)))
    titles = [Say(now.language).of(it.title) for it in steps if not changed or it.name in UNSET]
    counting = [] if facts else titles
    origin = f"{before.date}, {before.operator}"
    return {
        title: replace(found, origin=found.origin or origin)
        for title, found in before.steps
        if found.outcome == "passed" and title in counting
    }


def verdict(
    step: Step, session: CheckoutSession, note: Callable[[Verdict], None], say: Say = ENGLISH
) -> Verdict:
    """Run a step until the operator accepts its verdict, or skip it with a reason.

    ``note`` gets the verdict of each attempt.
    """
    if reason := choice(say("begin")):
        return Verdict("skipped", reason)
    note(Verdict("failed", say("incomplete")))
    earlier: list[Verdict] = []
    while True:
        try:
            found = step.run(session)
        except (KeyboardInterrupt, T2Error):
            note(session.so_far or Verdict("failed", say("incomplete")))
            raise
        session.so_far = None
        note(found)
        show(say("found", outcome=say(f"verdict.{found.outcome}"), text=found.text))
        whole = after(found, earlier, say)
        if found.outcome == "passed":
            return whole
        if remark := choice(say("again")):
            return replace(whole, text=say("remark", text=whole.text, remark=remark))
        earlier.append(found)


def now() -> str:
    """Return the local date and time."""
    return time.strftime("%Y-%m-%d %H:%M:%S %z")


def versions(session: CheckoutSession) -> list[Row]:
    """Return the version of each service that every robot has."""
    health = session.of(keys.HEALTH)
    session.until(lambda: {one.value.service for one in health} >= set(keys.ON_BOARD), HEALTH_S)
    found = {
        one.value.service: one.value.version for one in health if one.value.service in keys.ON_BOARD
    }
    return [(f"T2 of {service}", version) for service, version in sorted(found.items())]


def settings(session: CheckoutSession) -> list[tuple[str, str, str]]:
    """Return path, value and origin of the services' settings that matter here."""
    return [
        row
        for service, sections in SECTIONS.items()
        for row in of_sections(session.settings(service), sections)
    ]


def of_sections(
    found: Mapping[str, Setting], sections: Sequence[str]
) -> list[tuple[str, str, str]]:
    """Return path, value and origin of the settings of these sections."""
    return [
        (path, str(setting.value), setting.origin)
        for path, setting in found.items()
        if path.split(".")[0] in sections
    ]


def write(file: Path, text: str) -> None:
    """Write the report; print it if that fails."""
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        print(text, flush=True)
        raise ConfigError(f"--report {file}: cannot be written: {error.strerror}") from None


def report_file(given: Path | None, robot: str) -> Path:
    """Create the report's file before the drive; an existing one is never overwritten."""
    file = given or Path("out") / f"checkout-{robot}-{time.strftime('%Y%m%d-%H%M%S')}.md"
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.open("x").close()
    except FileExistsError:
        raise ConfigError(f"--report {file}: exists already; a report is not overwritten") from None
    except OSError as error:
        raise ConfigError(f"--report {file}: cannot be written: {error.strerror}") from None
    return file
