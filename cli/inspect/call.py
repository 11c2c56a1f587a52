"""``t2 call``: call a service; without a KEY, list the calls.

A request with ``echo`` is an operator's call. If the user gives no echo, safety's newest state
fills it in, and the causes of a reset. A reset succeeds when safety's state confirms it.
"""

import argparse
from typing import Any

import msgspec

from cli.inspect import output
from cli.inspect.addressing import chunks, expression, parse_one_key
from cli.inspect.payload import read
from cli.inspect.pub import json_object
from cli.inspect.session import BusSession, add_options, decoded, open_session, positive
from common import codec, keys
from common.bus.bus import no_answer, not_allowed
from common.bus.probe import Answer, Probe
from common.client import CONFIRM_S, confirms, reset_request
from common.errors import MessageError, RobotError
from common.keys import CALLS, Call
from common.messages import ResetDone, SafetyState

STATE_S = 1.0  # wait for a state of safety, which has 20 Hz
HEAD = ("key", "request", "reply", "does")

Request = dict[str, Any]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "key", metavar="KEY", nargs="?", type=parse_one_key,
        help="such as safety/reset; lists the calls if omitted",
    )  # fmt: skip
    parser.add_argument(
        "request", metavar="JSON", nargs="?", type=json_object, default={},
        help="""a JSON object, such as '{"held": false}'; all defaults if omitted; an operator's
        call takes `echo` and `causes` from safety's newest state if they are omitted""",
    )  # fmt: skip
    parser.add_argument(
        "--timeout", type=positive, default=2.0, metavar="S",
        help="wait for S seconds, 2 by default",
    )  # fmt: skip
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Call and show the reply; return 2 if the request is invalid."""
    if not options.key:
        rows = [
            (each.path, each.request.__name__, each.reply.__name__, each.what) for each in CALLS
        ]
        things = [dict(zip(HEAD, row, strict=True)) for row in rows]
        output.rows(things, HEAD, lambda row: list(row.values()), options.output)
        return 0
    robot, below = chunks(options.key.strip("/"))
    path = below or options.key.strip("/")
    options.robot = options.robot or robot  # of a whole key
    call = known(path)
    try:
        packed(call, options.request)
    except MessageError as error:
        output.warn(f"t2 call: {error}; see `t2 schema {path}`")
        return 2
    with open_session(options) as session:
        make(session, call, path, options)
    return 0


def make(
    session: BusSession, call: Call[Any, Any] | None, path: str, options: argparse.Namespace
) -> None:
    """Call and show the replies; raise ``RobotError`` if it failed or is unconfirmed."""
    request, seen = options.request, None
    if call and needs_state(call, request):
        session.probe.listen(keys.SAFETY.on(session.robot))
        seen = next(decoded(session.probe.samples(STATE_S), SafetyState), None)
        if seen is None:
            raise RobotError(
                "no state of safety within 1 s, and the call needs its heartbeat: "
                "is safety running? run `t2 doctor`"
            )
        request = filled(call, request, seen)
    key = call.on(session.robot) if call else expression(path, session.robot)
    answers = session.probe.query(key, packed(call, request), options.timeout)
    if not answers and call:
        raise RobotError(why_unanswered(session, call, key))
    if not answers:
        raise RobotError(f"no service answers on {key}; `t2 call` lists the calls")
    show(answers, options.output)
    if seen and call is keys.RESET and not is_confirmed(session.probe, seen, answers):
        raise RobotError("not confirmed: safety's state does not show this reset; run `t2 doctor`")


def why_unanswered(session: BusSession, call: Call[Any, Any], key: str) -> str:
    """Return why no service answers a call: it is absent or hangs, or the router drops the call.

    The router announces no queryable to a certificate that may not call it.
    """
    runs = session.probe.alive(keys.live_key(session.robot, call.server, "*"))
    if runs and not session.probe.has_server(key):
        return f"{key}: {not_allowed(call.server)}"
    return f"{key}: {no_answer(call.server)}"


def show(answers: list[Answer], form: str) -> None:
    """Print the replies; raise ``RobotError`` with the refusals."""
    for answer in answers:
        if not answer.refusal:
            output.value(read(answer.payload, answer.encoding).value, form)
    if refusals := [answer.refusal for answer in answers if answer.refusal]:
        raise RobotError(f"refused: {' '.join(refusals)}")


def known(path: str) -> Call[Any, Any] | None:
    """Return the call for ``srv/safety/reset`` or a shorter path; None if it is not ours."""
    found = [call for call in CALLS if f"/{call.path}".endswith(f"/{path}")]
    if len(found) > 1:
        names = ", ".join(call.path.removeprefix("srv/") for call in found)
        raise RobotError(f"{path} is ambiguous: {names}")
    return found[0] if found else None


def packed(call: Call[Any, Any] | None, request: Request) -> bytes:
    """Return the encoded request; raise ``MessageError`` for an invalid one."""
    if call is None:
        return msgspec.msgpack.encode(request)
    try:
        return codec.encode(msgspec.convert(request, call.request))
    except msgspec.ValidationError as error:
        raise MessageError(f"not a {call.request.__name__}: {error}") from None


def needs_state(call: Call[Any, Any], request: Request) -> bool:
    """Return whether a call needs safety's newest state."""
    if "echo" not in call.request.__struct_fields__:
        return False
    return call is keys.RESET or request.get("echo") is None


def filled(call: Call[Any, Any], request: Request, seen: SafetyState) -> Request:
    """Return the request with defaults filled in; for a reset, print the causes it clears."""
    given = {name: value for name, value in request.items() if value is not None}
    if call is keys.RESET and "causes" not in given:
        given["causes"] = list(reset_request(seen).causes)
        for cause in seen.causes:
            if cause.id in given["causes"]:
                output.warn(f"t2 call: clears {cause.name}: {cause.text}")
    return {"echo": seen.heartbeat, **given}


def is_confirmed(probe: Probe, seen: SafetyState, answers: list[Answer]) -> bool:
    """Return whether safety's state soon shows the reset that one of the answers claims."""
    done = list(decoded(answers, ResetDone))
    states = decoded(probe.samples(CONFIRM_S), SafetyState)
    return bool(done) and any(confirms(seen, claim, state) for state in states for claim in done)
