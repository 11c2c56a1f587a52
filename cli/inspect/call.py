"""``t2 call``: make a call to a service; without a KEY, what there is to call."""

import argparse
import sys
from typing import Any

import msgspec

from cli.inspect import output
from cli.inspect.addressing import expression, one_key
from cli.inspect.pub import json_object
from cli.inspect.reading import read
from cli.inspect.shell import add_options, positive, seated, wants_json
from common import codec
from common.errors import MessageError
from common.keys import CALLS, Call

Request = dict[str, Any]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "key", metavar="KEY", nargs="?", type=one_key, help="such as safety/reset; all without"
    )
    parser.add_argument(
        "request", metavar="JSON", nargs="?", type=json_object, default={},
        help="""a JSON object, such as '{"held": false}'; every default without""",
    )  # fmt: skip
    parser.add_argument(
        "--timeout", type=positive, default=2.0, metavar="S", help="wait so long, 2 s by default"
    )
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Call and show the reply; 1 when it is refused or nobody answers, 2 for a wrong request."""
    if not options.key:
        show_all(wants_json(options))
        return 0
    path = options.key.strip("/")
    call = known(path)
    try:
        payload = packed(call, options.request)
    except MessageError as error:
        print(f"t2 call: {error}; `t2 schema {path}` tells more", file=sys.stderr)
        return 2
    with seated(options) as seat:
        key = call.on(seat.robot) if call else expression(path, seat.robot)
        answers = seat.probe.ask(key, payload, options.timeout)
    if not answers:
        print(f"t2 call: {unanswered(key, call)}", file=sys.stderr)
        return 1
    for answer in answers:
        if answer.refusal:
            print(f"t2 call: refused: {answer.refusal}", file=sys.stderr)
            continue
        value = read(answer.payload, answer.encoding).value
        output.line(value) if wants_json(options) else print(output.fields(value))
    return 1 if any(answer.refusal for answer in answers) else 0


def known(path: str) -> Call[Any, Any] | None:
    """Return the call that is meant, ``srv/safety/reset`` or shorter; None for another's."""
    for call in CALLS:
        if call.path in (path, f"srv/{path}"):
            return call
    return None


def packed(call: Call[Any, Any] | None, request: Request) -> bytes:
    """Return the request's bytes; raise ``MessageError`` for what the call does not take."""
    if call is None:
        return msgspec.msgpack.encode(request)
    try:
        return codec.encode(msgspec.convert(request, call.request))
    except msgspec.ValidationError as error:
        raise MessageError(f"not a {call.request.__name__}: {error}") from None


def unanswered(key: str, call: Call[Any, Any] | None) -> str:
    """Say that nobody answers, and why that may be."""
    if call:
        return f"{call.server} does not answer on {key}: `t2 doctor` tells why"
    return f"nobody answers on {key}; `t2 call` alone shows what there is"


def show_all(as_json: bool) -> None:
    """Show what the robot's own services answer."""
    rows = [(call.path, call.request.__name__, call.reply.__name__, call.what) for call in CALLS]
    head = ("key", "request", "reply", "does")
    if as_json:
        for row in rows:
            output.line(dict(zip(head, row, strict=True)))
        return
    print(output.table(head, rows))
