"""``t2 call``: make a call to a service; without a KEY, what there is to call.

A call whose request has ``echo`` is an operator's. Where the user gives no echo, the newest state
of safety fills it in, and the causes of a reset. A reset counts when safety's state confirms it.
"""

import argparse
import sys
from typing import Any

import msgspec

from cli.inspect import operator_call, output
from cli.inspect.addressing import chunks, expression, one_key
from cli.inspect.payload import read
from cli.inspect.pub import json_object
from cli.inspect.shell import Seat, add_options, positive, seated, wants_json
from common import codec, keys
from common.bus.probe import Answer
from common.errors import MessageError, RobotError
from common.keys import CALLS, Call

Request = dict[str, Any]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "key", metavar="KEY", nargs="?", type=one_key, help="such as safety/reset; all without"
    )
    parser.add_argument(
        "request", metavar="JSON", nargs="?", type=json_object, default={},
        help="""a JSON object, such as '{"held": false}'; every default without; an operator's
        call takes `echo` and `causes` from safety's newest state where they are left out""",
    )  # fmt: skip
    parser.add_argument(
        "--timeout", type=positive, default=2.0, metavar="S", help="wait so long, 2 s by default"
    )
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Call and show the reply; 1 unless it is done and, for a reset, confirmed; 2 if wrong."""
    if not options.key:
        show_all(wants_json(options))
        return 0
    robot, below = chunks(options.key.strip("/"))
    path = below or options.key.strip("/")
    options.robot = options.robot or robot  # of a whole key
    call = known(path)
    try:
        packed(call, options.request)
    except MessageError as error:
        print(f"t2 call: {error}; `t2 schema {path}` tells more", file=sys.stderr)
        return 2
    with seated(options) as seat:
        trouble = make(seat, call, path, options)
    if trouble:
        print(f"t2 call: {trouble}", file=sys.stderr)
    return 1 if trouble else 0


def make(seat: Seat, call: Call[Any, Any] | None, path: str, options: argparse.Namespace) -> str:
    """Call and show what is replied; return what went wrong, or an empty text."""
    request, seen = options.request, None
    if call and operator_call.wants_state(call, request):
        seen = operator_call.newest(seat.probe, seat.robot)
        if seen is None:
            return operator_call.NO_STATE
        request = operator_call.filled(call, request, seen)
    key = call.on(seat.robot) if call else expression(path, seat.robot)
    answers = seat.probe.ask(key, packed(call, request), options.timeout)
    if not answers:
        return unanswered(key, call)
    refusals = show(answers, as_json=wants_json(options))
    if refusals:
        return f"refused: {' '.join(refusals)}"
    if seen and call is keys.RESET and not operator_call.confirmed(seat.probe, seen, answers):
        return "not confirmed: safety's state does not show this reset; run `t2 doctor`"
    return ""


def show(answers: list[Answer], *, as_json: bool) -> list[str]:
    """Show each reply; return the refusals."""
    for answer in answers:
        if not answer.refusal:
            value = read(answer.payload, answer.encoding).value
            output.line(value) if as_json else print(output.fields(value))
    return [answer.refusal for answer in answers if answer.refusal]


def known(path: str) -> Call[Any, Any] | None:
    """Return the call that is meant, ``srv/safety/reset`` or shorter; None for another's."""
    found = [call for call in CALLS if f"/{call.path}".endswith(f"/{path}")]
    if len(found) > 1:
        names = ", ".join(call.path.removeprefix("srv/") for call in found)
        raise RobotError(f"{path} is ambiguous: {names}")
    return found[0] if found else None


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
