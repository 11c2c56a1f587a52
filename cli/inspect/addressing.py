"""Keys and robots on the command line: short or whole keys, one robot, a site or all robots."""

import argparse
import re

from common.bus.inspector import valid
from t2 import codec, keys
from t2.codec import Sample
from t2.errors import MessageError
from t2.messages import Health, Message

# `**` does not match a chunk that begins with "@" (verbatim in Zenoh): both are needed for all.
EVERYTHING = ("**", "@cmd/**")
EVERY_ROBOT = "*"
# Robots of a site are called SITE-NUMBER. If a site's name could contain a dash, "north" would
# match the robots of "north-east", too.
SITE = re.compile(r"[A-Za-z0-9_.]+")


def add_key(parser: argparse.ArgumentParser, *, optional: bool = False) -> None:
    """Add the argument KEY, a key or a key expression."""
    parser.add_argument(
        "key", metavar="KEY", nargs="?" if optional else None, type=parse_key,
        help="tel/odom/odometry, odometry, 'tel/**', or a whole key t2/v1/001/...",
    )  # fmt: skip


def parse_key(word: str) -> str:
    """Check a key or key expression; short ones are relative to a robot."""
    if not valid(expression(word, "001")):
        raise argparse.ArgumentTypeError(f"{word!r} is not a key; `t2 ls` lists the active keys")
    return word


def parse_site(site: str) -> str:
    """Return the key expression chunk that matches the robots of a site."""
    if not SITE.fullmatch(site):
        raise argparse.ArgumentTypeError(
            f"{site!r} is not a site: use letters, digits, _ and . only, as berlin for berlin-007"
        )
    return f"{site}-$*"


def expression(word: str, robot: str) -> str:
    """Return the whole key or key expression for a typed key.

    ``/tel/odom/odometry`` equals ``tel/odom/odometry``, as in ROS. The last chunks are enough where
    exactly one topic ends with them (``odometry``, ``safety/state``, ``safety/health``).
    """
    path = word.strip("/")
    if path.startswith(f"{keys.ROOT}/"):
        return path
    return f"{keys.ROOT}/{robot}/{_completed(path)}"


def short(key: str, robot: str) -> str:
    """Return a key as displayed: without the prefix that all keys of this robot share."""
    return key.removeprefix(f"{keys.ROOT}/{robot}/")


def chunks(key: str) -> tuple[str, str]:
    """Return robot and path of a whole key; two empty strings for a foreign key."""
    parts = key.split("/", 3)
    return (parts[2], parts[3]) if len(parts) == 4 and key.startswith(f"{keys.ROOT}/") else ("", "")


def decode(sample: Sample, kind: type[codec.S]) -> codec.S:
    """Decode a sample; raise ``MessageError`` for an invalid one, or health of another service.

    Access rules protect keys, so only the key ``tel/{service}/health`` proves the sender. The name
    inside a message is not protected.
    """
    message = codec.decode(sample.payload, kind)
    if isinstance(message, Health) and message.service != chunks(sample.key)[1].split("/")[1]:
        raise MessageError("the message names another service than the key")
    return message


def topic_of(key: str) -> keys.Topic[Message] | None:
    """Return the topic of a whole key."""
    path = chunks(key)[1].split("/")
    for topic in keys.TOPICS:
        row = topic.path.split("/")
        if len(row) == len(path) and all(map(_matches, row, path)):
            return topic
    return None


def _completed(word: str) -> str:
    typed = word.split("/")
    if "**" in typed:
        return word
    found = {path for topic in keys.TOPICS if (path := _ending(topic.path.split("/"), typed))}
    return found.pop() if len(found) == 1 else word


def _ending(row: list[str], typed: list[str]) -> str:
    """Return a topic's path if it ends with the typed chunks, which fill its placeholders."""
    rest, end = row[: -len(typed)], row[-len(typed) :]
    if len(end) != len(typed) or not any(map(str.__eq__, end, typed)):
        return ""
    if not all(map(_matches, end, typed)):
        return ""
    return "/".join([*("*" if part.startswith("{") else part for part in rest), *typed])


def _matches(part: str, typed: str) -> bool:
    return part == typed or part.startswith("{")
