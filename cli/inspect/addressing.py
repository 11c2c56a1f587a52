"""Which keys the operator means: short or whole, one robot or all."""

import argparse
import re

from common import keys
from common.bus.probe import valid
from common.messages import Message

# An expression's `**` passes by what begins with "@", on purpose: both are needed for all.
EVERYTHING = ("**", "@cmd/**")
EVERY_ROBOT = "*"
# Robots of a site are called SITE-NUMBER. With a dash in its name, "north" would have the robots
# of "north-east", too.
SITE = re.compile(r"[A-Za-z0-9_.]+")


def add_key(parser: argparse.ArgumentParser, *, optional: bool = False) -> None:
    """Add the argument that names a key or many."""
    parser.add_argument(
        "key", metavar="KEY", nargs="?" if optional else None, type=keys_meant,
        help="tel/odom/odometry, odometry, 'tel/**', or a whole key t2/v1/001/...",
    )  # fmt: skip


def keys_meant(word: str) -> str:
    """Read a key or key expression; short ones are below a robot."""
    if not word.strip("/") or not valid(expression(word, "001")):
        raise argparse.ArgumentTypeError(f"{word!r} is no key; `t2 ls` shows what there is")
    return word


def one_key(word: str) -> str:
    """Read a key that is no expression."""
    if "*" in keys_meant(word):
        raise argparse.ArgumentTypeError(f"{word!r} means many keys, name one")
    return word


def robots_of(site: str) -> str:
    """Read a site's name; return what stands for its robots in a key expression."""
    if not SITE.fullmatch(site):
        raise argparse.ArgumentTypeError(
            f"{site!r} is no site: letters, digits, _ and . alone, as in berlin for berlin-007"
        )
    return f"{site}-$*"


def is_many(robot: str) -> bool:
    """Tell whether a robot's place in a key stands for more than one."""
    return "*" in robot


def expression(word: str, robot: str) -> str:
    """Return the whole key or key expression for what was typed.

    ``/tel/odom/odometry`` is taken for ``tel/odom/odometry``, as in ROS; the last parts will do
    where one row of the table ends with them (``odometry``, ``safety/state``, ``safety/health``).
    """
    path = word.strip("/")
    if path.startswith(f"{keys.ROOT}/"):
        return path
    return f"{keys.ROOT}/{robot}/{_path(path)}"


def short(key: str, robot: str) -> str:
    """Return a key as it is shown: without what all keys of this robot begin with."""
    return key.removeprefix(f"{keys.ROOT}/{robot}/")


def chunks(key: str) -> tuple[str, str]:
    """Return a whole key's robot and the path below it; two empty ones when it is none of ours."""
    parts = key.split("/", 3)
    return (parts[2], parts[3]) if len(parts) == 4 and key.startswith(f"{keys.ROOT}/") else ("", "")


PRETENDS = "the health of another service than the key's"


def speaker(key: str) -> str:
    """Return the service that a whole key of ``tel/{service}/...`` belongs to.

    Access rules go by keys, so only the key proves who speaks; what a message says of itself is
    anybody's.
    """
    return chunks(key)[1].split("/")[1]


def topic_of(key: str) -> keys.Topic[Message] | None:
    """Return the row of the table that a whole key belongs to."""
    path = chunks(key)[1].split("/")
    for topic in keys.TOPICS:
        row = topic.path.split("/")
        same = len(row) == len(path) and all(
            ours == theirs or ours.startswith("{") for ours, theirs in zip(row, path, strict=True)
        )
        if same:
            return topic
    return None


def _path(word: str) -> str:
    typed = word.split("/")
    if "**" in typed:
        return word
    found = {path for topic in keys.TOPICS if (path := _ending(topic.path.split("/"), typed))}
    return found.pop() if len(found) == 1 else word


def _ending(row: list[str], typed: list[str]) -> str:
    """Return a row's path when it ends with what was typed, which fills its gaps; else nothing."""
    rest, end = row[: -len(typed)], row[-len(typed) :]
    matches = [ours == theirs for ours, theirs in zip(end, typed, strict=False)]
    gaps = [ours.startswith("{") for ours in end]
    if len(end) != len(typed) or not any(matches):
        return ""
    if not all(same or gap for same, gap in zip(matches, gaps, strict=True)):
        return ""
    return "/".join([*("*" if part.startswith("{") else part for part in rest), *typed])
