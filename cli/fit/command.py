"""``t2 fit``: what recordings show of a vehicle, and the settings that follow from it."""

import argparse
import shlex
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from math import isfinite
from pathlib import Path

from cli.fit.answers import answers, order, restarts_s
from cli.fit.check import Course, Difference, compare
from cli.fit.check import lines as difference_lines
from cli.fit.closed import Closed, ClosedDrive, check_distinct, closed_drive
from cli.fit.files import model, profile, settings_file
from cli.fit.fit import Fit, fit, needed, reckoned, refusal
from cli.fit.page import page
from cli.fit.steady import greatest, of_ground_truth
from cli.fit.stops import Stop, counted, find_stops
from cli.fit.streams import KINDS, Streams
from cli.inspect import output
from cli.inspect.addressing import chunks
from cli.inspect.session import one_robot, positive
from cli.recordings.info import open_recording
from cli.recordings.recorded_settings import (
    NONE_RECORDED,
    Chosen,
    Found,
    differing,
    found_in,
    listed,
    named,
    newest,
    restored,
)
from cli.settings import Everything, safety_config
from common.cli_args import add_sources, file_path, sources
from common.config import Sources, flatten
from common.errors import ConfigError
from common.freshness import NS_PER_S
from t2 import keys
from t2.errors import T2Error
from t2.messages import Message

RED, PLAIN = "\x1b[31m", "\x1b[0m"
HEAD = ("parameter", "unit", "estimate", "95 % interval", "n", "setting", "today", "proposal")
STOPS = ("stop at (UTC)", "command", "unit", "speed", "reaction s", "deceleration", "distance",
         "needed", "reckoned")  # fmt: skip
SECTIONS = ("host", "board", "wire", "vehicle", "safety", "odom")
LIMITS = (
    "A slope, a wet floor, a load or worn tyres change stops: the table shows what was recorded. "
    "Record on the worst ground that the vehicle will drive on."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("files", metavar="RECORDING", type=file_path, nargs="+")
    parser.add_argument(
        "--out", type=file_path, metavar="FOLDER", help="out/fit-ROBOT-DATE by default"
    )
    parser.add_argument(
        "--check", type=file_path, metavar="RECORDING",
        help="drive the fitted vehicle with the commands of this recording, and compare",
    )  # fmt: skip
    parser.add_argument(
        "--drove", type=positive, metavar="M",
        help="the vehicle ended this far from its start, by a tape measure",
    )  # fmt: skip
    parser.add_argument(
        "--turned", type=positive, metavar="TURNS",
        help="it turned so often in one direction, by a mark on the ground",
    )  # fmt: skip
    parser.add_argument(
        "--closed", action="store_true",
        help="each recording ended where it began, place and heading, by a mark on the ground",
    )  # fmt: skip
    parser.add_argument("--stops", action="store_true", help="show a row for each stop, too")
    parser.add_argument("--robot", type=one_robot, help="which robot, such as 001")
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Show the estimates and write the files; return 0 if nothing is missing or wrong."""
    given = sources(options)
    of_files = named(given, SECTIONS) if options.config else None  # before recordings are read
    if options.out and options.out.exists():
        raise ConfigError(f"--out {options.out}: exists already; choose another folder")
    robot, streams, remarks, published = read(options.files, options.robot)
    chosen = of_files or today(published, given)
    settings = chosen.config
    try:
        found = fit(streams, settings, of_ground_truth(streams, options.drove, options.turned))
    except ValueError as error:
        raise T2Error(f"--drove, --turned: {error}") from None
    drives = closed_drives(options.files, robot, settings) if options.closed else []
    closed = Closed(drives, settings.odom)
    found.proposals |= closed.proposals
    warning = not_safe(found.too_long[0], settings) if found.too_long else ""
    if warning:
        print(red(warning), end="\n\n")
    print(output.table(HEAD, list(rows(found))), "", sep="\n")
    if options.stops and found.stops:
        print(output.table(STOPS, [as_cells(stop, settings) for stop in found.stops]), "", sep="\n")
    used = [f"Settings: {chosen.origin}.", *(f"Settings: {each}." for each in chosen.remarks)]
    text, checked, explained = [*used, *remarks, *lines(found), *closed.lines()], None, True
    if options.check:
        checked, differences = check(options.check, robot, found)
        text += ["", f"The model under the commands of {options.check}:"]
        text += difference_lines(differences)
        explained = all(each.is_explained for each in differences)
    print(*text, sep="\n")
    folder = options.out or Path("out") / f"fit-{robot}-{time.strftime('%Y%m%d-%H%M%S')}"
    html = partial(
        page, found, title=f"Robot {robot}, measured by t2 fit", not_safe=warning, head=HEAD,
        rows=list(rows(found)), lines=text, checked=checked,
    )  # fmt: skip
    write(folder, found, [file.name for file in options.files], html)
    print(f"Written: {shlex.quote(str(folder))}: fit.toml, profile.toml, fit.html", flush=True)
    return 1 if found.missing or warning or closed.gross or not explained else 0


def check(
    file: Path, robot: str, found: Fit
) -> tuple[tuple[Streams, Course], Sequence[Difference]]:
    """Return a recording with the model's course under its commands, and the differences."""
    _, (streams, *_), *_ = read([file], robot)
    stops, _ = find_stops(streams)
    try:
        course, differences = compare(streams, stops, model(found))
    except ValueError as error:
        raise T2Error(f"--check {file}: {error}") from None
    return (streams, course), differences


def closed_drives(files: Sequence[Path], robot: str, settings: Everything) -> list[ClosedDrive]:
    """Return the drives of recordings that ended where they began; raise ``T2Error``."""
    drives = []
    for file in files:
        _, (streams, *others), remarks, _ = read([file], robot)
        if others or remarks:
            problem = remarks[0] if remarks else "the robot's computer restarted"
            raise T2Error(f"--closed {file}: {problem}")
        try:
            drives.append(closed_drive(file.name, streams, settings.odom))
            check_distinct(drives)
        except ValueError as error:
            raise T2Error(f"--closed {file}: {error}") from None
    return drives


# --- recordings -----------------------------------------------------------------------------------


def read(
    files: Sequence[Path], robot: str | None
) -> tuple[str, Sequence[Streams], Sequence[str], Sequence[Found]]:
    """Return the robot, its streams for each start of its computer, remarks, and its settings.

    Raise ``T2Error`` for several robots (``robot`` chooses one), and without anything to measure.
    """
    robots: set[str] = set()
    by_host: defaultdict[int, Streams] = defaultdict(Streams)
    remarks: list[str] = []
    published: list[Found] = []
    for file in files:
        for name, message in _messages(file, remarks, published):
            if robot in (None, name):
                robots.add(name)
                by_host[message.host].add(message)
    if len(robots) > 1:
        raise T2Error(f"recordings of {', '.join(sorted(robots))}: choose one with --robot")
    usable, problems = [], []
    for streams in by_host.values():
        streams.sort()
        problems += [streams.problem] if streams.problem else []
        usable += [] if streams.problem else [streams]
    if not usable:
        names = ", ".join(map(str, files))
        of = f" of robot {robot}" if robot else ""
        problem = problems[0] if problems else f"has no message{of} to measure"
        raise T2Error(f"{names}: {problem}")
    remarks += [f"Left out, another start of the robot's computer: {each}." for each in problems]
    (name,) = robots
    return name, usable, remarks, [one for one in published if one.robot == name]


def _messages(
    file: Path, remarks: list[str], published: list[Found]
) -> Iterator[tuple[str, Message]]:
    """Yield robot and message of what is measured; add remarks on the file, and settings."""
    with open_recording(file) as reader:
        for entry in reader:
            if entry.kind in KINDS and (message := entry.message) is not None:
                yield chunks(entry.key)[0], message
            elif (found := found_in(entry, file)) and found.service in keys.ON_BOARD:
                published.append(found)
    if reader.cut or reader.damaged:
        remarks.append(f"{file}: truncated or damaged; what it holds is used.")


def today(published: Sequence[Found], given: Sources) -> Chosen:
    """Return the newest settings in recordings, without any those of files and environment."""
    if not published:
        chosen = named(given, SECTIONS)
        return replace(chosen, origin=f"{chosen.origin}: {NONE_RECORDED}")
    chosen = restored(newest(published), SECTIONS, given.sets)
    if several := differing(published, SECTIONS):
        disagree = f"the newest, because the recordings disagree about {listed(several)}"
        return replace(chosen, remarks=[disagree, *chosen.remarks])
    return chosen


def write(folder: Path, found: Fit, sources: Sequence[str], html: Callable[[], str]) -> None:
    """Write settings, the simulator's profile and the page; raise ``T2Error``."""
    texts = {
        "fit.toml": lambda: settings_file(found, sources),
        "profile.toml": lambda: profile(found, sources),
        "fit.html": html,  # last: it needs an extra
    }
    try:
        folder.mkdir(parents=True)
        for name, text in texts.items():
            (folder / name).write_text(text(), encoding="utf-8")
    except OSError as error:
        raise T2Error(f"--out {folder}: cannot be written: {error.strerror}") from None


# --- text -----------------------------------------------------------------------------------------


def red(text: str) -> str:
    """Return a text in red on a terminal."""
    return f"{RED}{text}{PLAIN}" if sys.stdout.isatty() else text


def not_safe(stop: Stop, settings: Everything) -> str:
    """Return the line about a stop that needed more than safety reckons with."""
    unit = stop.axis.unit
    return (
        f"NOT SAFE: {title(stop)} from {stop.speed:.2f} {unit}/s at {clock(stop)} UTC needed "
        f"{needed(stop):.2f} {unit}; safety reckons with "
        f"{reckoned(stop, safety_config(settings)):.2f} {unit}."
    )


def rows(found: Fit) -> Iterator[Sequence[str]]:
    """Yield the estimates as table cells."""
    today, shown = dict(flatten(found.settings)), set()
    for each in found.estimates:
        low, high = each.interval
        first = each.setting not in shown
        shown.add(each.setting)
        proposal = found.proposals.get(each.setting, "") if first else ""
        yield (
            each.name,
            each.unit,
            f"{each.mean:.4g}",
            f"{low:.4g} to {high:.4g}" if isfinite(low) else "-",
            str(len(each.values)),
            each.setting if first else "",
            str(today.get(each.setting, "")) if first else "",
            str(proposal),
        )


def as_cells(stop: Stop, settings: Everything) -> Sequence[str]:
    """Return one stop as table cells."""
    return (
        clock(stop),
        title(stop),
        stop.axis.unit,
        f"{stop.speed:.3f}",
        f"{stop.reaction:z.3f}",
        f"{stop.deceleration:.2f}",
        f"{stop.distance:.3f}",
        f"{needed(stop):.3f}",
        f"{reckoned(stop, safety_config(settings)):.3f}",
    )


def title(stop: Stop) -> str:
    """Return command and direction."""
    return f"{stop.kind.upper()} {stop.direction}" + ", then BRAKE" * stop.braked


def clock(stop: Stop) -> str:
    """Return the time of a stop, UTC."""
    return f"{datetime.fromtimestamp(stop.at_ns / NS_PER_S, UTC):%H:%M:%S}"


def of_streams(streams: Streams) -> Iterator[str]:
    """Yield what is said of the streams themselves."""
    speeds = greatest(streams)
    yield f"Greatest speeds: {speeds.linear:.2f} m/s and {speeds.angular:.2f} rad/s."
    for each in answers(streams):
        yield (
            f"{each.stream}: {each.messages} messages, {each.rate:.1f} Hz, "
            f"{each.lost:.2%} lost, longest gap {each.longest_gap:.3f} s, "
            f"jitter {each.jitter * 1000:.1f} ms."
        )
    if found := order(streams):
        after = ", ".join(f"{name} {s * 1000:.1f} ms" for name, s in found.delays.items())
        late = ", ".join(f"{name} in {number}" for name, number in found.late.items())
        yield (
            f"Order of the answers after their queries: {after}; {found.usual:.1%} of "
            f"{found.cycles} cycles{f', late: {late}' if late else ''}."
        )
    elif streams.links:
        yield "Order of the answers: not shown, without round trips of at most 10 ms."
    if streams.links:
        ports = streams.links[-1].ports.items()
        yield f"Ports of the answers: {', '.join(f'{name} {port}' for name, port in ports)}."
    for silent_s in restarts_s(streams):
        yield f"The board restarted: its counters were silent for {silent_s:.2f} s."


def lines(found: Fit) -> Iterator[str]:
    """Yield what is below the table."""
    for streams in found.streams:
        yield from of_streams(streams)
    for it in found.ranges:
        yield (
            f"sonars: {it.nearest:.3f} to {it.farthest:.3f} m, in steps of {it.resolution:.3f} m; "
            f"{it.no_echo:.2%} without an echo, {it.faulty:.2%} faulty, "
            f"{it.jumps:.2%} of the readings at standstill near for one sample."
        )
    if found.left_out:
        yield f"Stops left out: {counted(found.left_out)}."
    yield from (f"{hint}." for hint in found.hints)
    for manoeuvre in found.missing:
        yield f"NOT MEASURED: {manoeuvre}."
    if problem := refusal(found):
        yield f"NOT USABLE as it is, because safety refuses to start: {problem}."
    if not found.too_long and not found.missing:
        yield "No stop was longer than safety reckons with."
    yield LIMITS
