"""``t2 echo``: what comes on a key, right or wrong."""

import argparse
import sys
import time
from collections.abc import Iterator
from typing import Any

from cli.inspect import output
from cli.inspect.addressing import add_key, chunks, expression, short
from cli.inspect.payload import Reading, at, read
from cli.inspect.shell import Seat, add_end, add_options, quietly, seated, wants_json
from common.errors import MessageError
from common.freshness import NS_PER_S
from common.sample import Sample

SOON_S = 2.0  # the slowest streams come once a second
ONCE_S = 10.0  # for --once without --duration
HEADER = ("seq", "boot", "t_ns", "mono_ns", "host")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_key(parser)
    parser.add_argument(
        "--once", action="store_true", help=f"show one and end; gives up after {ONCE_S:g} s"
    )
    parser.add_argument(
        "--field", metavar="NAME", help="this field alone, such as x or causes.0.name"
    )
    parser.add_argument("--header", action="store_true", help="the whole header, too")
    add_end(parser)
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """Show what comes until it ends; 0 when anything came."""
    shown = 0
    most = 1 if options.once else options.count
    duration_s = options.duration or (ONCE_S if options.once else None)
    with seated(options) as seat:
        wanted = expression(options.key, seat.robot)
        # Events are rare: those that their publishers have kept are shown first.
        seat.probe.listen(wanted, history=chunks(wanted)[1].startswith("evt/"))
        with quietly():
            for heard in coming(seat, wanted, duration_s):
                shown += 1
                show(heard, seat, options)
                if shown == most:
                    break
        left_out = seat.probe.left_out
    if left_out:
        print(f"t2 echo: {left_out} more came faster than they could be shown", file=sys.stderr)
    if not shown:
        within = f" within {duration_s:g} s" if duration_s else ""
        text = f"t2 echo: no message on {wanted}{within}; `t2 ls` lists the keys that are alive"
        print(text, file=sys.stderr)
    return 0 if shown else 1


def coming(seat: Seat, wanted: str, duration_s: float | None) -> Iterator[Sample]:
    """Yield what comes; say so when nothing does at first."""
    begun_s = time.monotonic()
    first = seat.probe.take(SOON_S if duration_s is None else min(SOON_S, duration_s))
    if first is not None:
        yield first
    elif duration_s is None or duration_s > SOON_S:
        print(f"t2 echo: nothing on {wanted} yet; it goes on listening", file=sys.stderr)
    left_s = None if duration_s is None else duration_s - (time.monotonic() - begun_s)
    yield from seat.probe.samples(left_s)


def show(heard: Sample, seat: Seat, options: argparse.Namespace) -> None:
    """Print one sample."""
    reading = read(heard.payload, heard.encoding)
    if options.field:
        value = field(reading, heard, options.field)
        output.line(value) if wants_json(options) else print(output.fields(value), flush=True)
    elif wants_json(options):
        output.line(as_json(heard, reading, seat.robot))
    elif options.output == "table":
        print(as_row(heard, reading, seat.robot, options.header), flush=True)
    else:
        print(as_text(heard, reading, seat.robot, options.header), flush=True)


def field(reading: Reading, heard: Sample, path: str) -> Any:
    """Return one field; raise ``MessageError`` naming those that there are."""
    try:
        return at(reading.value, path)
    except MessageError as error:
        raise MessageError(f"--field {path} of {heard.key} ({reading.kind}): {error}") from None


def as_json(heard: Sample, reading: Reading, robot: str) -> dict[str, Any]:
    """Return a sample for programs."""
    told = {"key": short(heard.key, robot), "type": reading.kind, "received_ns": heard.wall_ns}
    if heard.deleted:
        told["deleted"] = True
    if reading.complaint:
        told["complaint"] = reading.complaint
    return told | {"message": reading.value}


def as_text(heard: Sample, reading: Reading, robot: str, header: bool) -> str:
    """Return a sample for people: a line that names it, its fields, and ``---`` as in ROS."""
    value = reading.value
    seq = f"  seq {value['seq']}" if isinstance(value, dict) and "seq" in value else ""
    what = "DELETE" if heard.deleted else reading.kind
    lines = [f"# {short(heard.key, robot)}  {what}{seq}  {clock(heard)}"]
    if reading.complaint:
        lines.append(f"# not as it should be: {reading.complaint}")
    value = body(value, header)
    if value not in (None, {}):
        lines.append(output.fields(value))
    return "\n".join([*lines, "---"])


def as_row(heard: Sample, reading: Reading, robot: str, header: bool) -> str:
    """Return a sample as one line: time, key, and its fields as JSON."""
    value = "DELETE" if heard.deleted else output.json(body(reading.value, header))
    complaint = f"  # not as it should be: {reading.complaint}" if reading.complaint else ""
    return f"{clock(heard)}  {short(heard.key, robot)}  {output.printable(value)}{complaint}"


def body(value: Any, header: bool) -> Any:
    """Return a message without its header, unless that is wanted."""
    if header or not isinstance(value, dict):
        return value
    return {name: each for name, each in value.items() if name not in HEADER}


def clock(heard: Sample) -> str:
    """Return the local time at which a sample was received, to the millisecond."""
    wall = time.strftime("%H:%M:%S", time.localtime(heard.wall_ns // NS_PER_S))
    return f"{wall}.{heard.wall_ns // 1_000_000 % 1000:03d}"
