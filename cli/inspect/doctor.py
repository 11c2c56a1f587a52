"""``t2 doctor``: diagnosis of the path from this laptop to the wheels, with remedies.

It checks in the order of a request's path: network, router, services, versions, rights, clock,
relay, link, streams, the pose in the map, and the causes that safety reports. It only listens and
queries; it changes nothing.
"""

import argparse
import shlex
import socket
import ssl
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec

from cli.inspect import output
from cli.inspect.addressing import EVERYTHING, chunks, decode, expression, topic_of
from cli.inspect.diagnosis import Observation, diagnose
from cli.inspect.estop import is_barred
from cli.inspect.findings import MARKS, PLACES, PREFIX, Finding, found
from cli.inspect.output import padded
from cli.inspect.session import add_duration, add_options, services, settings, until_interrupt
from common.bus.inspector import Inspector, inspecting
from common.bus.session import common_name
from common.cli_args import VERSION, reader_language, source_words
from common.freshness import NS_PER_S
from common.settings import BusSettings, Shared
from common.text import printable
from t2 import keys
from t2.codec import Sample
from t2.errors import LinkError, MessageError
from t2.keys import Topic
from t2.messages import (
    Camera,
    Field,
    Health,
    Link,
    MapPose,
    PatrolState,
    Phrase,
    SafetyState,
)
from t2.text_file import pem_problem
from t2.words import Language, in_language

LISTEN_S = 3.0  # a 1 Hz stream arrives at least twice
CONNECT_S = 2.0
ALERT_S = 0.3  # after the handshake, the router's alert about our certificate arrives within this
# Tables of settings that name sources, and names that are tried without the settings.
SOURCES: dict[Topic[Any], tuple[str, tuple[str, ...]]] = {
    keys.DRIVE: ("safety.sources", ("teleop", "web")),
    keys.LIMIT: ("safety.limits", ()),
}
STREAMS = ("tcp", "tls", "ws")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_duration(parser, LISTEN_S)
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Print all findings; return 1 if something is wrong."""
    language = reader_language()
    robot, wrong = ["--robot", options.robot] if options.robot else [], 0
    for one in findings(settings(options), options.duration):
        wrong += one.level == "wrong"
        if options.json:
            output.line(as_json(one))
        else:
            print(as_text(one, language), flush=True)
    words = [*robot, *source_words(options)]
    if not options.json:
        if wrong and words:
            options_text = found("", "note", "options", words=shlex.join(words))
            print(f"\n{options_text.text(language)}")
        count = {0: "none_found", 1: "one_found"}.get(wrong, "found")
        print(f"\n{found('', 'ok', count, count=wrong).text(language)}")
    return 1 if wrong else 0


def findings(config: Shared, seconds: float) -> Iterator[Finding]:
    """Yield the findings in order; without a router the rest is unknown."""
    attempts = [connect(endpoint, config.bus) for endpoint in config.bus.endpoints]
    is_reached = any(each.level != "wrong" for each in attempts)
    for each in attempts:
        yield replace(each, level="note") if is_reached and each.level == "wrong" else each
    if not is_reached:
        yield found("router", "unknown", "router.unreachable")
        return
    try:
        with inspecting(config.bus) as opened:
            seen = observe(opened, config.bus, config.robot.id, seconds)
    except LinkError:
        yield found("router", "wrong", "router.other", "other_router")
        return
    yield from diagnose(seen, config.robot.id)


def connect(endpoint: str, bus: BusSettings) -> Finding:
    """Connect to one endpoint with a plain socket, to find problems below Zenoh."""
    protocol, _, rest = endpoint.partition("/")
    address = rest.partition("?")[0].partition("#")[0]
    trouble: Finding | None = None
    took_s = 0.0
    if protocol == "unixsock-stream":
        if not Path(address).exists():
            trouble = problem("no_socket", "socket")
    elif protocol not in STREAMS:
        return found("network", "unknown", "network.untested", endpoint=endpoint)
    else:
        name, _, port = address.rpartition(":")
        host = name.strip("[]")
        begin_s = time.monotonic()
        try:
            with socket.create_connection((host, int(port)), CONNECT_S) as plain:
                took_s = time.monotonic() - begin_s
                trouble = handshake(plain, host, bus) if protocol == "tls" else None
        except OSError as error:
            trouble = explain(error, host, protocol)
    if trouble:
        where = Phrase(f"{PREFIX}network.at", {"endpoint": endpoint})
        return replace(trouble, phrases=(where, *trouble.phrases))
    return found("network", "ok", "network.answers", endpoint=endpoint, ms=took_s * 1000)


def problem(name: str, remedy: str = "certificate", /, **fields: Field) -> Finding:
    """Return a problem of an endpoint."""
    return found("network", "wrong", f"network.{name}", remedy, **fields)


def explain(error: OSError, host: str, protocol: str) -> Finding:
    """Return the problem of a failed connection."""
    match error:
        case socket.gaierror():
            return problem("unknown_host", "host_name", host=host)
        case ConnectionRefusedError():
            return problem("refused", "refused")
        case TimeoutError():
            return problem("no_answer", "no_route", protocol=protocol)
    reason = (error.strerror or str(error)).lower()
    return problem("error", "no_route", protocol=protocol, reason=reason)


def handshake(plain: socket.socket, host: str, bus: BusSettings) -> Finding | None:
    """Do a TLS handshake; return the problem, None if both certificates are valid."""
    try:
        for name in ("ca", "certificate", "private_key"):
            if wrong := pem_problem(Path(getattr(bus, name)).read_bytes()):
                return problem("file", name=name, problem=wrong)
        context = ssl.create_default_context(cafile=bus.ca)
        context.load_cert_chain(bus.certificate, bus.private_key)
    except OSError as error:  # the base class of SSLError
        reason = error.strerror or getattr(error, "reason", "") or str(error)
        return problem("files", reason=str(reason))
    try:
        with context.wrap_socket(plain, server_hostname=host) as sock:
            sock.settimeout(ALERT_S)
            sock.recv(1)  # in TLS 1.3 the server checks our certificate after our handshake ends
    except ssl.SSLCertVerificationError as error:
        return problem("untrusted", reason=error.verify_message)
    except ssl.SSLError as error:
        reason = (error.reason or str(error)).lower().replace("_", " ")
        return problem("certificate_refused", reason=reason)
    except TimeoutError:
        return None  # the router has accepted us and waits for the first message of a session
    return problem("closed")


def observe(opened: Inspector, bus: BusSettings, robot: str, seconds: float) -> Observation:
    """Return the observation of one robot."""
    seen = Observation(t2=VERSION)
    listen(opened, robot, seconds, seen)
    running: list[tuple[str, str]] = []
    try:
        running = services(opened, "*")
        seen.instances = Counter(service for name, service in running if name == robot)
    except LinkError:
        seen.listed = False
        seen.instances = dict.fromkeys(seen.healths, 1)
    on_board = {name for name, service in running if service in keys.ON_BOARD}
    seen.others = sorted(on_board - {robot})
    if seen.listed and not running and not seen.rates:
        # The rules allow all members to query the admin space, and nothing to anybody else.
        seen.stranger = "" if opened.query("@/*/*") else common_name(bus)
    if "safety" in seen.instances:
        seen.sources, seen.limits = (as_source(opened, robot, topic) for topic in SOURCES)
        seen.calls = [
            each.path.removeprefix("srv/") for each in keys.CALLS
            if each not in keys.READING_CALLS
            and each.server in seen.instances and opened.has_server(each.on(robot))
        ]  # fmt: skip
        if "patrol" in seen.instances and (names := configured(opened, robot, "safety.sources")):
            seen.obeys_patrol = "patrol" in names
        is_fleet = common_name(bus).startswith("fleet.")  # it may stop, and nothing else
        seen.may_stop = is_fleet or bool(seen.sources) or not is_barred(opened, robot)
    for sample in opened.queued():  # the queries take seconds: judge what has arrived meanwhile
        add_sample(sample, seen)
    return seen


def as_source(opened: Inspector, robot: str, topic: Topic[Any]) -> list[str]:
    """Return the sources of safety's settings as which this certificate may publish."""
    table, usual = SOURCES[topic]
    names = {*usual} | configured(opened, robot, table)
    by_key = {topic.on(robot, source=name): name for name in names}
    return sorted(by_key[key] for key in opened.readers(by_key))


def configured(opened: Inspector, robot: str, table: str) -> set[str]:
    """Return the names of a table in safety's settings; none without an answer."""
    return {
        path.split(".")[2]
        for answer in opened.query(keys.info_key(robot, "safety", "config"))
        if not answer.refusal
        for path in msgspec.json.decode(answer.payload, type=dict[str, Any])
        if path.startswith(f"{table}.")
    }


def listen(opened: Inspector, robot: str, seconds: float, seen: Observation) -> None:
    """Add the messages of one robot to the observation."""
    counts: Counter[str] = Counter()
    for word in EVERYTHING:
        opened.listen(expression(word, robot))
    with until_interrupt():
        for sample in opened.samples(seconds):
            counts[chunks(sample.key)[1]] += 1
            add_sample(sample, seen)
    seen.rates = {path: count / seconds for path, count in counts.items()}


NEWEST = {MapPose: "pose", PatrolState: "patrol", SafetyState: "state"}  # fields of the observation


def add_sample(sample: Sample, seen: Observation) -> None:
    """Add one sample, if its key is a topic."""
    path, topic = chunks(sample.key)[1], topic_of(sample.key)
    if topic is None:
        return
    try:
        message = decode(sample, topic.message)
    except MessageError as error:
        seen.undecodable[path] = str(error)
        return
    if path.startswith("tel/"):
        seen.delays_s.append((sample.wall_ns - message.t_ns) / NS_PER_S)
    match message:
        case Health():
            seen.healths[message.service] = message
        case Link():
            seen.links.append(message)
        case Camera():
            seen.cameras[message.camera] = message
            seen.camera_boots.setdefault(message.camera, set()).add(message.boot)
        case MapPose() | PatrolState() | SafetyState():
            setattr(seen, NEWEST[type(message)], message)


def as_json(one: Finding) -> dict[str, str]:
    """Return a finding in English, with its stable name."""
    head = {"where": one.where, "level": one.level, "name": one.name}
    return head | {"text": one.text(), "todo": one.todo()}


def as_text(one: Finding, language: Language) -> str:
    """Return a finding as text, with its remedy on a second line."""
    where, mark = (in_language(it, language) for it in (PLACES[one.where], MARKS[one.level]))
    text = f"{padded(where, 9)} {padded(mark, 6)} {printable(one.text(language))}"
    todo = one.todo(language)
    return f"{text}\n{'':17}-> {printable(todo)}" if todo else text
