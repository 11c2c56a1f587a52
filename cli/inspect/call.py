"""``t2 call``: call a service; without a KEY, list the calls.

A request with ``echo`` is an operator's call: safety's newest state fills it in, and the causes of
a reset. A reset succeeds when safety's state confirms it.
"""

import argparse
from typing import Any

import msgspec

from cli.inspect import output
from cli.inspect.client import SafetyClient
from cli.inspect.payload import localized, read
from cli.inspect.session import add_options, open_session
from common.cli_args import reader_language
from t2 import codec, keys
from t2.client import reset_request
from t2.errors import T2Error
from t2.keys import CALLS, Call
from t2.messages import SafetyState
from t2.words import Language, render

Request = dict[str, Any]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "key",
        metavar="KEY",
        nargs="?",
        type=known,
        help="such as safety/reset; lists the calls if omitted",
    )
    parser.add_argument(
        "request", metavar="JSON", nargs="?", type=json_object, default={},
        help="""a JSON object, such as '{"bumper_brake": true}'; all defaults if omitted; a reset
        clears the `causes` in safety's newest state if they are omitted""",
    )  # fmt: skip
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Call and show the reply; return 2 if the request is invalid."""
    if not options.key:
        rows = [
            {"key": each.path, "request": each.request.__name__, "reply": each.reply.__name__,
             "does": each.what} for each in CALLS
        ]  # fmt: skip
        output.rows(rows, as_json=options.json)
        return 0
    call, language = options.key, reader_language()
    if problem := complaint(call.request, options.request):
        name = call.request.__name__
        output.warn(f"t2 call: not a {name}: {problem}; its fields: docs/bus.md#{name.lower()}")
        return 2
    with open_session(options) as session:
        make(SafetyClient(session.inspector, session.robot, language=language), call, options)
    return 0


def make(client: SafetyClient, call: Call[Any, Any], options: argparse.Namespace) -> None:
    """Call and show the replies; raise ``T2Error`` if it failed or is unconfirmed."""
    request, seen = options.request, None
    if "echo" in call.request.__struct_fields__:
        seen = client.fresh_state()
        request = filled(call, request, seen, client.language)
    typed = msgspec.convert(request, call.request)
    answers = client.call(call, typed)
    for answer in answers:
        value = read(answer.payload, answer.encoding).value
        shown = value if options.json else localized(value, client.language)
        output.value(shown, as_json=options.json)
    if seen and call is keys.RESET and not client.is_reset(seen, answers):
        text = "not confirmed: safety's state does not show this reset"
        raise T2Error(f"{text}; run {client.inspector.doctor}")


def known(word: str) -> Call[Any, Any]:
    """Return the call for ``srv/safety/reset`` or a shorter path."""
    path = word.strip("/")
    found = [call for call in CALLS if f"/{call.path}".endswith(f"/{path}")]
    if not found:
        raise argparse.ArgumentTypeError(f"no call {path}; `t2 call` lists the calls")
    if len(found) > 1:
        names = ", ".join(call.path.removeprefix("srv/") for call in found)
        raise argparse.ArgumentTypeError(f"{path} is ambiguous: {names}")
    return found[0]


def complaint(kind: type[msgspec.Struct], request: Request) -> str:
    """Return why it is no request of this type; empty if it is one.

    A server ignores names that it does not know: a misspelled one would leave a default in force.
    """
    if unknown := sorted(set(request) - set(kind.__struct_fields__)):
        return f"no field {unknown[0]!r}"
    try:
        codec.encode(msgspec.convert(request, kind))
    except (msgspec.ValidationError, OverflowError) as error:
        return str(error)
    return ""


def filled(
    call: Call[Any, Any], request: Request, seen: SafetyState, language: Language
) -> Request:
    """Return the request with the state's echo; for a reset, print the causes it clears."""
    request = {**request, "echo": seen.heartbeat}
    if call is keys.RESET and "causes" not in request:
        request["causes"] = list(reset_request(seen).causes)
        for cause in seen.causes:
            if cause.id in request["causes"]:
                text = render(cause.phrases, language, cause.text)
                output.warn(f"t2 call: asks to clear {cause.name}: {text}")
    return request


def json_object(text: str) -> Request:
    """Parse the request."""
    try:
        return msgspec.json.decode(text, type=Request)
    except (msgspec.DecodeError, RecursionError) as error:
        raise argparse.ArgumentTypeError(
            f"""{text!r} is not a JSON object, such as '{{"x": 1}}': {error}"""
        ) from None
