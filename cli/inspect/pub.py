"""``t2 pub``: publish on a key of your own, at 1 Hz by default.

Keys that command motion, and keys of the robot's own services, are refused. ``--simulator`` allows
them for a simulated vehicle. The option alone is not enough: the bridge reports the address of its
board, and a simulated board is on the bridge's own host.
"""

import argparse
import ipaddress
import json
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import msgspec

from cli.inspect import estop, output
from cli.inspect.addressing import chunks, expression, parse_one_key, short, topic_of
from cli.inspect.session import (
    BusSession,
    add_end,
    add_options,
    open_session,
    positive,
    settings,
    until_interrupt,
    wants_json,
)
from common import cli_codec, codec, keys
from common.bus.probe import Probe
from common.codec import Sample
from common.errors import MessageError, RobotError
from common.keys import Topic
from common.messages import Link, Message, SafetyState, SourceMessage
from common.settings import is_encrypted

FIRST_S = 2.0  # wait for safety's first heartbeat, which has 20 Hz
PASS_S = 1.0  # wait for our own message, through the router
LINK_S = 1.5  # the bridge publishes its link at 5 Hz; listen long enough to find a second bridge
OWN_SERVICES = ("bridge", "safety", "odom")  # other services act on their messages


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "key", metavar="KEY", type=parse_one_key, help="such as tel/mine/temperature"
    )
    parser.add_argument(
        "message", metavar="JSON", nargs="?", type=json_object, default={},
        help="""a JSON object, such as '{"celsius": 21.5}'; the header is filled in""",
    )  # fmt: skip
    parser.add_argument(
        "--rate", "-r", type=positive, default=1.0, metavar="HZ", help="1 Hz by default"
    )
    parser.add_argument("--once", "-1", action="store_true", help="publish one message and end")
    parser.add_argument(
        "--simulator", action="store_true",
        help="allow commands to a simulated vehicle; refused if the board is real",
    )  # fmt: skip
    add_end(parser)
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Publish until the end; return 2 for an invalid message."""
    robot, path = chunks(expression(options.key, settings(options).robot.id))
    if path == keys.ESTOP_PATH:
        return estop.run(options, robot)
    with open_session(options) as session:
        key = expression(options.key, session.robot)
        check_permission(key, options.simulator, session.probe)
        try:
            check_message(key, options.message)
        except MessageError as error:
            output.warn(f"t2 pub: {error}; see `t2 schema {options.key}`")
            return 2
        has_reader = session.probe.watch_readers(key)
        if not has_reader():
            output.warn(f"t2 pub: no reader on {short(key, session.robot)} yet")
        with until_interrupt():
            publish(session, key, options, has_reader)
    return 0


def json_object(text: str) -> dict[str, Any]:
    """Parse the message."""
    try:
        message = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise argparse.ArgumentTypeError(f"{text!r} is not JSON: {error}") from None
    if not isinstance(message, dict):
        raise argparse.ArgumentTypeError(f"""{text!r} is not an object, such as '{{"x": 1}}'""")
    try:
        msgspec.msgpack.encode(message)
    except (OverflowError, RecursionError) as error:
        raise argparse.ArgumentTypeError(f"MessagePack cannot encode it: {error}") from None
    return message


def check_message(key: str, message: dict[str, Any]) -> None:
    """Raise ``MessageError`` if the message does not match the type of its key."""
    topic = topic_of(key)
    if topic:
        whole = {"echo": 0} | message if echoes(topic) else message
        try:
            msgspec.convert(whole, topic.message)
        except msgspec.ValidationError as error:
            raise MessageError(f"not a {topic.message.__name__}: {error}") from None


def echoes(topic: Topic[Message]) -> bool:
    """Return whether the topic's messages echo safety's heartbeat."""
    return issubclass(topic.message, SourceMessage)


def publish(
    session: BusSession, key: str, options: argparse.Namespace, has_reader: Callable[[], bool]
) -> None:
    """Publish the message at the rate; a message of a source echoes safety's newest heartbeat.

    Raise ``RobotError`` if the router does not pass the first one on.
    """
    probe, message, topic = session.probe, options.message, topic_of(key)
    encoding = codec.encoding(topic.message) if topic else codec.ENCODING
    service = topic.service if topic else keys.SLOW
    safety = keys.SAFETY.on(chunks(key)[0])
    wants_echo = topic is not None and echoes(topic) and "echo" not in message
    if wants_echo:
        probe.listen(safety)
    for number in publish_times(options):
        echo = {"echo": newest_heartbeat(probe, safety)} if wants_echo else {}
        payload = cli_codec.encode(key, json.dumps(echo | message))
        put = partial(probe.put, key, payload, encoding, service)
        if number > 1:
            put()
        elif not passes(session, options, key, put, payload):
            raise RobotError(
                f"not published: the router drops {short(key, session.robot)}; "
                "this certificate may not publish there (see `t2 keys list`)"
            )
        if wants_json(options):
            known = {"key": short(key, session.robot), "published": number}
            output.line(known | {"reader": has_reader()})
        else:
            none = "" if has_reader() else ", no reader"
            print(f"published {number} on {short(key, session.robot)}{none}", flush=True)


def passes(
    session: BusSession,
    options: argparse.Namespace,
    key: str,
    put: Callable[[], None],
    payload: bytes,
) -> bool:
    """Publish, and return whether the router passes it on; without TLS it passes everything.

    It drops what a certificate may not publish, without an error. A second session of the same
    certificate, which may read every key, shows it.
    """
    if not any(map(is_encrypted, settings(options).bus.endpoints)):
        put()
        return True
    with open_session(options) as second:
        second.probe.listen(key)
        session.probe.has_reader(key)  # until the router has announced the second session
        put()
        return any(sample.payload == payload for sample in second.probe.samples(PASS_S))


def publish_times(options: argparse.Namespace) -> Iterator[int]:
    """Yield 1, 2, 3 when each message is due."""
    most = 1 if options.once else options.count
    begin_s, number = time.monotonic(), 0
    while number != most:
        due_s = number / options.rate
        if options.duration and due_s > options.duration:
            return
        time.sleep(max(0.0, begin_s + due_s - time.monotonic()))
        number += 1
        yield number


def newest_heartbeat(probe: Probe, safety: str) -> int:
    """Return the heartbeat that a request echoes; waits for the first one only."""
    newest: Sample | None = None
    while sample := probe.take(0.0 if newest else FIRST_S):
        if sample.key == safety:
            newest = sample
    return codec.decode(newest.payload, SafetyState).heartbeat if newest else 0


def check_permission(key: str, simulator: bool, probe: Probe) -> None:
    """Raise ``RobotError`` for a key that a tool must not publish on."""
    refusal = refused(key)
    if not refusal:
        return
    if not simulator:
        raise RobotError(
            f"{chunks(key)[1]} {refusal}. `t2 drive` drives, `t2 estop` stops; "
            "--simulator allows it for a simulated vehicle"
        )
    robot = chunks(key)[0]
    found = boards(robot, probe)
    if not found:
        raise RobotError(f"--simulator: no bridge of robot {robot} reports its board")
    for board in sorted(found):
        if not is_loopback(board):
            raise RobotError(f"--simulator: the board of robot {robot} is at {board}: a real one")


def refused(key: str) -> str:
    """Return why a tool must not publish on a key; an empty string if it may."""
    if any(part.startswith("@") for part in key.split("/")):
        return "moves the wheels"
    kind, _, rest = chunks(key)[1].partition("/")
    service = rest.partition("/")[0]
    if kind in ("tel", "evt") and service in OWN_SERVICES:
        return f"is reserved for {service}: other services act on it"
    return ""


def boards(robot: str, probe: Probe) -> set[str]:
    """Return the boards, ``address:port``, that bridges of this robot report."""
    key = keys.LINK.on(robot)
    probe.listen(key)
    samples = [sample for sample in probe.samples(LINK_S) if sample.key == key]
    return {codec.decode(sample.payload, Link).board for sample in samples}


def is_loopback(board: str) -> bool:
    """Return whether an ``address:port`` is on the host itself."""
    try:
        return ipaddress.ip_address(board.rpartition(":")[0].strip("[]")).is_loopback
    except ValueError:
        return False
