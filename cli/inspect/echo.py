"""``t2 echo``: print messages received on a key, valid or not."""

import argparse
import time
from typing import Any

from cli.inspect import output
from cli.inspect.addressing import add_key, chunks, expression, short
from cli.inspect.payload import Reading, at, localized, read
from cli.inspect.session import add_duration, add_options, open_session, until_interrupt
from common.cli_args import hint, reader_language, source_words
from common.freshness import NS_PER_S
from common.text import printable
from t2.codec import Sample
from t2.errors import T2Error
from t2.messages import Event
from t2.words import Language

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
    add_duration(parser)
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """Print messages; raise ``T2Error`` if none arrived."""
    shown, language = False, reader_language()
    duration_s = options.duration or (ONCE_S if options.once else None)
    with open_session(options) as session:
        wanted = expression(options.key, session.robot)
        # Events are rare: those that their publishers have cached are shown first.
        session.inspector.listen(wanted, history=chunks(wanted)[1].startswith("evt/"))
        with until_interrupt():
            for sample in session.inspector.samples(duration_s):
                shown = True
                show(sample, session.robot, options, language)
                if options.once:
                    break
    if not shown:
        within = f" within {duration_s:g} s" if duration_s else ""
        active = hint("ls", source_words(options))
        raise T2Error(f"no message on {wanted}{within}; {active} lists the active keys")
    return 0


def show(sample: Sample, robot: str, options: argparse.Namespace, language: Language) -> None:
    """Print one sample in the format of the options."""
    reading = read(sample.payload, sample.encoding)
    if options.field:
        output.value(at(reading.value, options.field), as_json=options.json)
    elif options.json:
        output.line(as_json(sample, reading, robot))
    else:
        print(printable(as_text(sample, reading, robot, language), "\n"), flush=True)


def as_json(sample: Sample, reading: Reading, robot: str) -> dict[str, Any]:
    """Return a sample as a JSON object."""
    head = {"key": short(sample.key, robot), "type": reading.kind, "received_ns": sample.wall_ns}
    if reading.complaint:
        head["complaint"] = reading.complaint
    return head | {"message": reading.value}


def as_text(sample: Sample, reading: Reading, robot: str, language: Language) -> str:
    """Return a sample as text: a title line, its fields, and ``---`` as in ROS."""
    value, seq = localized(reading.value, language), ""
    if isinstance(value, dict):
        seq = f"  seq {value['seq']}" if "seq" in value else ""
        value = {name: each for name, each in value.items() if name not in HEADER}
    lines = [f"# {short(sample.key, robot)}  {reading.kind}{seq}  {clock(sample, reading)}"]
    if reading.complaint:
        lines.append(f"# invalid: {reading.complaint}")
    if value not in (None, {}):
        lines.append(output.fields(value))
    return "\n".join([*lines, "---"])


def clock(sample: Sample, reading: Reading) -> str:
    """Return the local receive time; of an event, which may be old, its publisher's time."""
    wall_ns, form = sample.wall_ns, "%H:%M:%S"
    if reading.kind == Event.__name__ and not reading.complaint:
        wall_ns, form = reading.value.get("t_ns") or wall_ns, "%Y-%m-%d %H:%M:%S"
    at_text = time.strftime(form, time.localtime(wall_ns // NS_PER_S))
    return f"{at_text}.{wall_ns // 1_000_000 % 1000:03d}"
