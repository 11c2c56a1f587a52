"""Listens to one robot for the doctor, and notes what came."""

from collections import Counter

from cli.inspect.addressing import EVERYTHING, PRETENDS, chunks, expression, speaker, topic_of
from cli.inspect.diagnosis import Seen
from cli.inspect.shell import quietly
from common import codec
from common import messages as m
from common.bus.probe import Probe
from common.bus.publisher import host_id
from common.errors import MessageError
from common.freshness import NS_PER_S
from common.sample import Sample


def listen(probe: Probe, robot: str, seconds: float, seen: Seen) -> None:
    """Note what comes within so many seconds."""
    counts: Counter[str] = Counter()
    host = host_id()
    for word in EVERYTHING:
        probe.listen(expression(word, robot))
    with quietly():
        for heard in probe.samples(seconds):
            counts[chunks(heard.key)[1]] += 1
            note(heard, seen, host)
    seen.rates = {path: count / seconds for path, count in counts.items()}


def note(heard: Sample, seen: Seen, host: int) -> None:
    """Note one sample, when it is one of the table's."""
    path, topic = chunks(heard.key)[1], topic_of(heard.key)
    if topic is None:
        return
    try:
        message = codec.decode(heard.payload, topic.message)
    except MessageError as error:
        seen.undecodable[path] = str(error)
        return
    if isinstance(message, m.Health) and message.service != speaker(heard.key):
        seen.undecodable[path] = PRETENDS
        return
    if path.startswith("tel/"):
        seen.delays_s.append((heard.wall_ns - message.t_ns) / NS_PER_S)
        seen.one_clock |= host != 0 and message.host == host
    keep(message, path.rsplit("/", 1)[-1], seen)


def keep(message: m.Message, name: str, seen: Seen) -> None:
    """Keep the newest of each kind; ``name`` is the last part of its key."""
    match message:
        case m.Health():
            seen.health[message.service] = message
        case m.Link():
            seen.first_link = seen.first_link or message
            seen.link = message
        case m.Switches():
            seen.switches = message
        case m.Bumper():
            seen.bumper = message
        case m.Ultrasonic():
            seen.ultrasonic = message
        case m.Driver():
            seen.drivers[name] = message
        case m.SafetyState():
            seen.safety = message
        case _:
            keep_command(message, name, seen)


def keep_command(message: m.Message, name: str, seen: Seen) -> None:
    """Keep who asks to move, and who decides."""
    match message:
        case m.Drive():
            seen.asking.setdefault(name, set()).add(message.boot)
        case m.Motion():
            seen.deciding.add(message.boot)
