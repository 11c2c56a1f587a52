"""``t2 pub``: publish on a key of your own, once a second unless told otherwise.

It speaks for no part of the robot, see ``permission``.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator
from typing import Any

import msgspec

from cli.inspect import estop, output
from cli.inspect.addressing import chunks, expression, one_key, short, topic_of
from cli.inspect.permission import check
from cli.inspect.shell import (
    Seat,
    add_end,
    add_options,
    positive,
    quietly,
    seated,
    settings,
    wants_json,
)
from common import cli_codec, codec, keys
from common.bus.probe import Probe
from common.errors import MessageError
from common.messages import Drive, SafetyState
from common.sample import Sample

FIRST_S = 2.0  # until safety has told its heartbeat, twenty times a second


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("key", metavar="KEY", type=one_key, help="such as tel/mine/temperature")
    parser.add_argument(
        "message", metavar="JSON", nargs="?", type=json_object, default={},
        help="""a JSON object, such as '{"celsius": 21.5}'; the header is filled in""",
    )  # fmt: skip
    parser.add_argument("--rate", "-r", type=positive, default=1.0, metavar="HZ", help="1 Hz")
    parser.add_argument("--once", "-1", action="store_true", help="publish one and end")
    parser.add_argument(
        "--simulator", action="store_true",
        help="let it command a simulated vehicle; refused when the board is a real one",
    )  # fmt: skip
    add_end(parser)
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Publish until it ends; 2 for what the key does not carry."""
    robot, path = chunks(expression(options.key, settings(options).robot.id))
    if path == keys.ESTOP_PATH:
        return estop.insist(options, robot)
    with seated(options) as seat:
        key = expression(options.key, seat.robot)
        check(key, options.simulator, seat.probe)
        try:
            message = fitting(key, options.message)
        except MessageError as error:
            print(f"t2 pub: {error}; `t2 schema {options.key}` tells more", file=sys.stderr)
            return 2
        if not seat.probe.has_reader(key):
            print(f"t2 pub: nobody reads {short(key, seat.robot)} yet", file=sys.stderr)
        with quietly():
            publish(seat, key, message, options)
    return 0


def json_object(text: str) -> dict[str, Any]:
    """Read the message."""
    try:
        message = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise argparse.ArgumentTypeError(f"{text!r} is no JSON: {error}") from None
    if not isinstance(message, dict):
        raise argparse.ArgumentTypeError(f"""{text!r} is no object, such as '{{"x": 1}}'""")
    try:
        msgspec.msgpack.encode(message)
    except (OverflowError, RecursionError) as error:
        raise argparse.ArgumentTypeError(f"MessagePack cannot carry it: {error}") from None
    return message


def fitting(key: str, message: dict[str, Any]) -> dict[str, Any]:
    """Return the message; raise ``MessageError`` when the key carries another type."""
    topic = topic_of(key)
    if topic:
        whole = {"echo": 0} | message if topic.message is Drive else message
        try:
            msgspec.convert(whole, topic.message)
        except msgspec.ValidationError as error:
            raise MessageError(f"not a {topic.message.__name__}: {error}") from None
    return message


def publish(seat: Seat, key: str, message: dict[str, Any], options: argparse.Namespace) -> None:
    """Put it at the rate until it has been enough."""
    topic = topic_of(key)
    encoding = codec.encoding(topic.message) if topic else codec.ENCODING
    service = topic.service if topic else keys.SLOW
    robot = chunks(key)[0]
    echoes = topic is not None and topic.message is Drive and "echo" not in message
    if echoes:
        seat.probe.listen(keys.SAFETY.on(robot))
    for number in moments(options):
        echo = {"echo": newest_heartbeat(seat.probe, robot)} if echoes else {}
        payload = cli_codec.encode(key, json.dumps(echo | message))
        seat.probe.put(key, payload, encoding, service)
        if wants_json(options):
            output.line({"key": short(key, seat.robot), "published": number})
        else:
            print(f"published {number} on {short(key, seat.robot)}", flush=True)


def moments(options: argparse.Namespace) -> Iterator[int]:
    """Yield 1, 2, 3 when each is due."""
    most = 1 if options.once else options.count
    begin_s, number = time.monotonic(), 0
    while number != most:
        due_s = number / options.rate
        if options.duration and due_s > options.duration:
            return
        time.sleep(max(0.0, begin_s + due_s - time.monotonic()))
        number += 1
        yield number


def newest_heartbeat(probe: Probe, robot: str) -> int:
    """Return what a request has to echo; waits for the first one, and no longer for others."""
    newest: Sample | None = None
    while heard := probe.take(0.0 if newest else FIRST_S):
        if heard.key == keys.SAFETY.on(robot):
            newest = heard
    return codec.decode(newest.payload, SafetyState).heartbeat if newest else 0
