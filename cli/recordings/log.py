"""``t2 log``: stops, take-overs, resets and rounds of the last days, with names.

Without a path the recorder of a robot answers. With paths it reads shift logs (``*-log.jsonl``) and
recordings (``*.mcap``): of a recording only the chunks with events, unless it is cut.
"""

import argparse
import re
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from cli.inspect import output
from cli.inspect.addressing import chunks
from cli.inspect.session import add_options, positive
from cli.patrol.calls import ask, local, open_client
from cli.recordings.info import open_recording
from common.cli_args import file_path, reader_language
from common.freshness import NS_PER_S
from services.recorder import shift, shift_log
from services.recorder.shift import Seen, Span
from t2 import keys
from t2.errors import T2Error
from t2.log_texts import HEADS, KINDS, QUIET
from t2.messages import Event, LogRow
from t2.words import Language, in_language, render

if TYPE_CHECKING:
    from services.recorder.mcap_codec import Entry

DAY_NS = 86_400 * NS_PER_S
STAMP = re.compile(r"-(\d{8}-\d{6})(?:-.*)?\.mcap")  # of the recorder's names, UTC
LASTS = timedelta(hours=1)  # longer than any recording
PAGE = 500  # rows of a call


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "paths", type=file_path, nargs="*", metavar="PATH",
        help="folders with recordings, recordings (.mcap) or shift logs (-log.jsonl); "
        "without any, the recorder of the robot is asked",
    )  # fmt: skip
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--days", type=positive, metavar="N",
        help="the last N days, 1 by default; of folders, the days before their end; files are "
        "read whole by default",
    )  # fmt: skip
    which.add_argument(
        "--since", type=moment, metavar="TIME", help="since 2026-11-28, or '2026-11-28 22:00'"
    )
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Print the rows, the oldest first."""
    language = reader_language()
    rows = of_paths(options) if options.paths else of_robot(options)
    if options.json:
        for row in rows:
            output.line(msgspec.to_builtins(row))
    elif rows:
        several = len({row.robot for row in rows}) > 1
        cells = [cells_of(row, language) for row in rows]
        names = [name for name in cells[0] if name != "robot" or several]
        head = [in_language(HEADS[name], language) for name in names]
        output.text(output.table(head, [[each[name] for name in names] for each in cells]))
    else:
        output.warn(f"t2 log: {in_language(QUIET, language)}")
    return 0


def moment(text: str) -> int:
    """Parse a date, or a date and a time, in this computer's time zone by default."""
    try:
        return round(datetime.fromisoformat(text).timestamp() * NS_PER_S)
    except (ValueError, OverflowError, OSError):
        raise argparse.ArgumentTypeError(
            f"{text!r} is no time: write 2026-11-28, or '2026-11-28 22:00'"
        ) from None


def cells_of(row: LogRow, language: Language) -> dict[str, str]:
    """Return a row as cells of the table."""
    begin, end = local(row.t_ns), local(row.end_ns) if row.end_ns else ""
    text = render(row.phrases, language, row.text)
    return {
        "robot": row.robot,
        "begin": begin,
        "end": end[11:] if end[:10] == begin[:10] else end,
        "kind": in_language(KINDS[row.kind], language),
        "text": f"{text} ({row.recording})" if row.recording else text,
    }


def of_robot(options: argparse.Namespace) -> list[LogRow]:
    """Return what the recorder of a robot answers."""
    since_ns = options.since
    if since_ns is None:
        since_ns = max(1, time.time_ns() - round((options.days or 1.0) * DAY_NS))
    rows: list[LogRow] = []
    with open_client(options) as client:
        before_ns = None
        while True:
            reply = ask(client, keys.LOG, since_ns=since_ns, before_ns=before_ns, most=PAGE)
            rows += reply.rows
            if not reply.more or not reply.rows:
                return rows[::-1]
            before_ns = reply.rows[-1].t_ns


# --- files ------------------------------------------------------------------------------


@dataclass
class Found:
    """What the files have of one robot."""

    seen: list[Seen] = field(default_factory=list)
    spans: list[Span] = field(default_factory=list)


def of_paths(options: argparse.Namespace) -> list[LogRow]:
    """Return the rows of files and folders; raise ``T2Error`` if there are none."""
    robots: defaultdict[str, Found] = defaultdict(Found)
    files = list(files_of(options.paths))
    logs = [file for file in files if file.name.endswith(shift_log.SUFFIX)]
    for file in logs:
        read_log(file, robots[shift_log.robot_of(file)])
    recordings = [file for file in files if file not in logs]
    now_ns = time.time_ns()
    ends = [span.end_ns for found in robots.values() for span in found.spans]
    begins = [begin for file in recordings if (begin := began_ns(file))]
    newest_ns = max((at for at in (*ends, *begins) if at <= now_ns), default=0)  # by a right clock
    since_ns = options.since
    days: float | None = options.days
    if days is None and any(path.is_dir() for path in options.paths):
        days = 1.0
    if since_ns is None and days is not None and newest_ns:
        since_ns = newest_ns - round(days * DAY_NS)
    for file in recordings:
        begin_ns = began_ns(file)
        if begin_ns and since_ns and begin_ns + LASTS.total_seconds() * NS_PER_S < since_ns:
            continue
        read_recording(file, robots, is_given=file in options.paths)
    if options.robot is not None and options.robot not in robots:
        known = ", ".join(sorted(robots)) or "no robot"
        raise T2Error(f"nothing of robot {options.robot} is recorded here, only of {known}")
    wanted = {name: it for name, it in robots.items() if options.robot in (None, name)}
    ends = [span.end_ns for found in wanted.values() for span in found.spans]
    if max(ends, default=0) <= (since_ns or 0):
        raise T2Error(
            "no state of safety of that time is recorded here: what happened is not known"
        )
    until_ns = max(min(end, now_ns) for end in ends)
    rows = [
        row
        for robot, found in wanted.items()
        for row in shift.rows(robot, found.seen, found.spans, since_ns=since_ns, until_ns=until_ns)
    ]
    return sorted(rows, key=lambda row: row.t_ns)


def files_of(paths: list[Path]) -> Iterator[Path]:
    """Yield the given files, and those below the given folders."""
    for path in paths:
        if not path.is_dir():
            yield path
            continue
        found = [*path.rglob("*.mcap"), *path.rglob(f"*{shift_log.SUFFIX}")]
        if not found:
            raise T2Error(
                f"{path}: has no recordings (*.mcap) and no shift log (*{shift_log.SUFFIX})"
            )
        yield from sorted(found)


def began_ns(file: Path) -> int | None:
    """Return the begin of a recording by its name; None for a name that has none."""
    match = STAMP.search(file.name)
    try:
        begin = datetime.strptime(match[1], "%Y%m%d-%H%M%S") if match else None
    except ValueError:
        return None
    return round(begin.replace(tzinfo=UTC).timestamp() * NS_PER_S) if begin else None


def read_log(file: Path, found: Found) -> None:
    """Read a shift log; raise ``T2Error`` if that is not possible."""
    try:
        seen, spans = shift_log.history(shift_log.read_lines(file))
    except OSError as error:
        raise T2Error(f"{file}: cannot be read: {error.strerror}") from None
    found.seen += seen
    found.spans += spans


def read_recording(file: Path, robots: defaultdict[str, Found], *, is_given: bool) -> None:
    """Read a recording; one that is damaged is warned of, unless it is given by its name."""
    try:
        with open_recording(file) as reader:
            if reader.is_indexed:
                for key, begin_ns, end_ns in reader.periods(is_safety):
                    add_span(robots[chunks(key)[0]].spans, begin_ns, end_ns)
                for entry in reader.selected(is_event):
                    add(entry, robots)
            else:  # cut, or still being written
                for entry in reader:
                    add(entry, robots)
        if reader.damaged:
            output.warn(f"t2 log: {file}: {reader.damaged} damaged parts: rows may be missing")
    except T2Error as error:
        if is_given:
            raise
        output.warn(f"t2 log: {error}")


def add(entry: "Entry", robots: defaultdict[str, Found]) -> None:
    """Add a message of a recording."""
    found = robots[chunks(entry.key)[0]]
    if is_safety(entry.key):
        add_span(found.spans, entry.log_ns, entry.log_ns)
    elif is_event(entry.key) and isinstance(event := entry.message, Event):
        service = entry.key.rpartition("/")[2]
        if shift.is_logged(service, event):
            found.seen.append(Seen(entry.log_ns, service, event))


def add_span(spans: list[Span], begin_ns: int, end_ns: int) -> None:
    """Add a time with states of safety; one that is near extends the last one."""
    if spans and 0 <= begin_ns - spans[-1].end_ns <= shift.GAP_NS:
        spans[-1] = Span(spans[-1].begin_ns, end_ns)
    else:
        spans.append(Span(begin_ns, end_ns))


def is_safety(key: str) -> bool:
    """Return whether a key has the states of safety."""
    return chunks(key)[1] == keys.SAFETY.path


def is_event(key: str) -> bool:
    """Return whether a key has events."""
    return chunks(key)[1].startswith("evt/")
