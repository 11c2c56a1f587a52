"""``t2 echo``: print messages received on a key, valid or not."""

import argparse
import time
from collections.abc import Iterator
from typing import Any

from cli.inspect import output
from cli.inspect.addressing import add_key, chunks, expression, short
from cli.inspect.payload import Reading, at, read
from cli.inspect.session import BusSession, add_end, add_options, open_session, until_interrupt
from common.codec import Sample
from common.errors import MessageError, RobotError
from common.freshness import NS_PER_S
from common.messages import Event
from common.text import printable

FIRST_S = 2.0  # the slowest streams have 1 Hz
ONCE_S = 10.0  # for --once without --duration
HEADER = ("seq", "boot", "t_ns", "mono_ns", "host")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_key(parser)
    parser.add_argument(
        "--once", action="store_true", help=f"print one message; give up after {ONCE_S:g} s"
    )
    parser.add_argument(
        "--field", metavar="NAME", help="print this field only, such as x or causes.0.name"
    )
    parser.add_argument("--header", action="store_true", help="print the whole header, too")
    add_end(parser)
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """Print messages; raise ``RobotError`` if none arrived."""
    shown = 0
    most = 1 if options.once else options.count
    duration_s = options.duration or (ONCE_S if options.once else None)
    with open_session(options) as session:
        wanted = expression(options.key, session.robot)
        # Events are rare: those that their publishers have cached are shown first.
        session.probe.listen(wanted, history=chunks(wanted)[1].startswith("evt/"))
        with until_interrupt():
            for sample in samples(session, wanted, duration_s):
                shown += 1
                show(sample, session.robot, options)
                if shown == most:
                    break
        left_out = session.probe.left_out
    if left_out:
        output.warn(f"t2 echo: {left_out} messages dropped: output too slow")
    if not shown:
        within = f" within {duration_s:g} s" if duration_s else ""
        raise RobotError(f"no message on {wanted}{within}; `t2 ls` lists the active keys")
    return 0


def samples(session: BusSession, wanted: str, duration_s: float | None) -> Iterator[Sample]:
    """Yield samples; print a notice if none arrives at first."""
    begun_s = time.monotonic()
    first = session.probe.take(FIRST_S if duration_s is None else min(FIRST_S, duration_s))
    if first is not None:
        yield first
    elif duration_s is None or duration_s > FIRST_S:
        output.warn(f"t2 echo: no message on {wanted} yet; waiting")
    left_s = None if duration_s is None else duration_s - (time.monotonic() - begun_s)
    yield from session.probe.samples(left_s)


def show(sample: Sample, robot: str, options: argparse.Namespace) -> None:
    """Print one sample in the format of the options."""
    reading = read(sample.payload, sample.encoding)
    if options.field:
        output.value(field(reading, sample, options.field), options.output)
    elif options.output == "json":
        output.line(as_json(sample, reading, robot))
    else:
        form = as_line if options.output == "table" else as_text
        print(printable(form(sample, reading, robot, options.header), "\n"), flush=True)


def field(reading: Reading, sample: Sample, path: str) -> Any:
    """Return one field; raise ``MessageError`` naming the existing fields."""
    try:
        return at(reading.value, path)
    except MessageError as error:
        raise MessageError(f"--field {path} of {sample.key} ({reading.kind}): {error}") from None


def as_json(sample: Sample, reading: Reading, robot: str) -> dict[str, Any]:
    """Return a sample as a JSON object."""
    head = {"key": short(sample.key, robot), "type": reading.kind, "received_ns": sample.wall_ns}
    if sample.deleted:
        head["deleted"] = True
    if reading.complaint:
        head["complaint"] = reading.complaint
    return head | {"message": reading.value}


def as_text(sample: Sample, reading: Reading, robot: str, header: bool) -> str:
    """Return a sample as text: a title line, its fields, and ``---`` as in ROS."""
    value = reading.value
    seq = f"  seq {value['seq']}" if isinstance(value, dict) and "seq" in value else ""
    kind = "DELETE" if sample.deleted else reading.kind
    lines = [f"# {short(sample.key, robot)}  {kind}{seq}  {clock(sample, reading)}"]
    if reading.complaint:
        lines.append(f"# invalid: {reading.complaint}")
    value = body(value, header)
    if value not in (None, {}):
        lines.append(output.fields(value))
    return "\n".join([*lines, "---"])


def as_line(sample: Sample, reading: Reading, robot: str, header: bool) -> str:
    """Return a sample as one line: time, key, and its fields as JSON."""
    value = "DELETE" if sample.deleted else output.json(body(reading.value, header))
    complaint = f"  # invalid: {reading.complaint}" if reading.complaint else ""
    head = f"{clock(sample, reading)}  {short(sample.key, robot)}"
    return f"{head}  {value}{complaint}"


def body(value: Any, header: bool) -> Any:
    """Return a message, without its header unless ``header`` is set."""
    if header or not isinstance(value, dict):
        return value
    return {name: each for name, each in value.items() if name not in HEADER}


def clock(sample: Sample, reading: Reading) -> str:
    """Return the local receive time, to the millisecond; of an event, the time of its publisher.

    A stored event is received long after it happened: one of another day has its date.
    """
    wall_ns, form = sample.wall_ns, "%H:%M:%S"
    if reading.kind == Event.__name__ and not reading.complaint:
        wall_ns = reading.value.get("t_ns") or wall_ns
    at, today = (time.localtime(ns // NS_PER_S) for ns in (wall_ns, sample.wall_ns))
    if at[:3] != today[:3]:
        form = "%Y-%m-%d %H:%M:%S"
    return f"{time.strftime(form, at)}.{wall_ns // 1_000_000 % 1000:03d}"
