"""The gateway's types, hashes and payloads against rclpy of Jazzy, in both directions.

rclpy reads what the gateway publishes and random messages of ``services.ros2.cdr``, and writes them
again. Both sides must agree in each value and hash. Bytes are not compared: those between aligned
values, and after the last one, are not set.
"""

import json
import math
import random
import re
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from services.ros2 import cdr
from services.ros2.definitions import FIELDS, HASHES
from verification.ros2.hiroz import Robot

PACKAGES = (
    "ros-jazzy-rclpy==7.1.6", "ros-jazzy-rmw-fastrtps-cpp==8.4.3", "ros-jazzy-nav-msgs==5.3.6",
    "ros-jazzy-diagnostic-msgs==5.3.6", "ros-jazzy-geometry-msgs==5.3.6",
    "ros-jazzy-sensor-msgs==5.3.6", "ros-jazzy-std-srvs==5.3.6",
    "--no-binary=empy",  # which has no wheel
)  # fmt: skip
ABSENT = ("tf2_msgs/",)  # packages without a wheel
PEER = Path(__file__).with_name("rclpy_peer.py")
SEED, MESSAGES, LISTEN_S = 45, 200, 3.0
KEY = re.compile(r".*/(\w+)::(msg)::dds_::(\w+)_/(RIHS01_\w+)")
INTEGERS = {
    "uint8": (0, 255), "byte": (0, 255), "int32": (-(2**31), 2**31 - 1), "uint32": (0, 2**32 - 1),
    "int64": (-(2**63), 2**63 - 1), "uint64": (0, 2**64 - 1),
}  # fmt: skip
EMPTY = cdr.HEADER + b"\0"  # of ROS
FLOATS = (0.0, -1.5, math.inf, math.nan, 1 / 64)  # exact in 32 bits, too
CHOICES: Mapping[str, Sequence[Any]] = {
    "bool": (True, False), "float32": FLOATS, "float64": (*FLOATS, 1e300, math.pi),
    "string": ("", "t2", "前方障碍物", "a" * 300, "é\n\t\"'"),
}  # fmt: skip
Payloads = Mapping[str, list[bytes]]


def check(robot: Robot, python: Path) -> str:
    """Compare what the gateway publishes, and random messages; return the numbers."""
    published, hashes = listen(robot)
    assert len(published) >= 4, f"only {sorted(published)} were published"
    dice = random.Random(SEED)
    made = {
        name: [cdr.encode(name, value(dice, name)) for _ in range(MESSAGES)]
        for name in FIELDS
        if FIELDS[name] and not name.startswith(ABSENT)  # the gateway sends no empty message
    }
    made["std_srvs/srv/Trigger_Request"] = [EMPTY]
    for payloads in (published, made):
        compare(payloads, asked(python, payloads))
    answers = asked(python, {name: [] for name in made if name in HASHES or "/srv/" in name})
    for name, answer in answers.items():
        assert answer["hash"] == HASHES[name.partition("_Re")[0]], name
    for name, found in hashes.items():
        assert found == HASHES[name], name
    count = sum(map(len, (*published.values(), *made.values())))
    return f"{len(made)} types and {count} messages agree, {len(published)} types as published"


def listen(robot: Robot) -> tuple[dict[str, list[bytes]], dict[str, str]]:
    """Return what the gateway publishes, and the hashes in its keys, by type."""
    payloads, hashes = dict[str, list[bytes]](), dict[str, str]()

    def received(sample: Any) -> None:
        if match := KEY.fullmatch(str(sample.key_expr)):
            name = "/".join(match.groups()[:3])
            hashes[name] = match[4]
            if not name.startswith(ABSENT):
                payloads.setdefault(name, []).append(sample.payload.to_bytes())

    subscriber = robot.client.bus.declare_subscriber("0/**", received)
    time.sleep(LISTEN_S)
    subscriber.undeclare()
    return payloads, hashes


def asked(python: Path, payloads: Payloads) -> dict[str, Any]:
    """Return rclpy's answers."""
    question = {name: [each.hex() for each in some] for name, some in payloads.items()}
    done = subprocess.run(
        [str(python), "-P", str(PEER)], input=json.dumps(question), capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{done.stderr[:400]} ... {done.stderr[-400:]}"
    return dict(json.loads(done.stdout))


def compare(payloads: Payloads, answers: Mapping[str, Any]) -> None:
    """Raise ``AssertionError`` if rclpy reads or writes anything else than the gateway."""
    for name, some in payloads.items():
        rows = zip(some, answers[name]["values"], answers[name]["payloads"], strict=True)
        for payload, read, written in rows:
            ours = cdr.decode(name, payload)
            assert same(ours, read), f"{name}: rclpy reads {read}, the gateway {ours}"
            back = cdr.decode(name, bytes.fromhex(written))
            assert same(ours, as_lists(back)), f"{name}: rclpy writes {back}, the gateway {ours}"


def as_lists(part: Any) -> Any:
    """Return a value with lists in place of tuples."""
    return [as_lists(each) for each in part] if isinstance(part, tuple) else part


def same(ours: Any, theirs: Any) -> bool:
    """Return whether two values are equal; not a number equals itself."""
    if isinstance(ours, tuple):
        return len(ours) == len(theirs) and all(map(same, ours, theirs))
    if isinstance(ours, float) and math.isnan(ours):
        return math.isnan(theirs)
    return bool(ours == theirs)


def value(dice: random.Random, name: str) -> cdr.Value:
    """Return a random value of a type."""
    item, bracket, rest = name.partition("[")
    if bracket:
        size = rest.rstrip("]")
        most = int(size.removeprefix("<=") or 5)
        count = most if size.isdigit() else dice.randint(0, most)
        return tuple(value(dice, item) for _ in range(count))
    if item in INTEGERS:
        return dice.choice([*INTEGERS[item], dice.randint(*INTEGERS[item])])
    if item in CHOICES:
        return dice.choice(CHOICES[item])
    return tuple(value(dice, kind) for _, kind in FIELDS[item])
