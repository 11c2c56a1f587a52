"""A ROS 2 node on plain Zenoh, written from the description of rmw_zenoh's wire.

``python plain_peer.py tcp/HOST:PORT PAUSE`` runs ``exercise`` and prints its results as JSON; the
planner is silent for so many seconds. It imports nothing of T2, so that it runs with any version of
Zenoh. SI units.
"""

import itertools
import json
import queue
import struct
import sys
import threading
import time
from collections.abc import Callable
from contextlib import closing
from functools import partial
from importlib.metadata import version
from typing import Any, NamedTuple

import xxhash
import zenoh
import zenoh.ext

PATIENCE_S = 15.0
PERIOD_S = 0.05
MOTION_S = 2.0
HALT_S = 1.5  # the vehicle stands then
KEY_DELAY_S, KEY_REPEAT_S = 0.5, 0.033  # of a terminal, for a key that is held

TWIST = (
    "geometry_msgs::msg::dds_::TwistStamped_/"
    "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"
)
ODOMETRY = (
    "nav_msgs::msg::dds_::Odometry_/"
    "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"
)
TEXT = (
    "std_msgs::msg::dds_::String_/"
    "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
)
TRIGGER = (
    "std_srvs::srv::dds_::Trigger_/"
    "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
)
LIST = (
    "rcl_interfaces::srv::dds_::ListParameters_/"
    "RIHS01_3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d"
)
QOS = "::,10:,:,:,,"
CDR = b"\0\1\0\0"
FRAME = b"base_link\0"
SPEED_FROM_END = (36 + 6) * 8  # of an odometry: six velocities and their covariance end it


class Twist(NamedTuple):
    """A command."""

    linear: float = 0.0
    angular: float = 0.0

    def encode(self) -> bytes:
        """Return a geometry_msgs/TwistStamped with a zero stamp."""
        axes = self.linear, 0.0, 0.0, 0.0, 0.0, self.angular
        return CDR + struct.pack("<iII10s2x6d", 0, 0, len(FRAME), FRAME, *axes)


FORWARD = Twist(0.4)
COMMANDS = "MP", "/cmd_vel", TWIST
NUMBERS = itertools.count(1)


class Endpoint:
    """A publisher (MP) or client (SC): its liveliness token, and its attachments."""

    def __init__(self, session: zenoh.Session, kind: str, name: str, about: str) -> None:
        zid, mangled = session.info.zid(), name.replace("/", "%")
        token = f"@ros2_lv/0/{zid}/0/{next(NUMBERS)}/{kind}/%/%/plain_peer/{mangled}/{about}/{QOS}"
        self._gid = xxhash.xxh3_128_digest(token.encode())[::-1]
        self.key = f"0/{name.strip('/')}/{about}"
        self._session, self._sequence = session, 0
        self._token = session.liveliness().declare_token(token)

    def attachment(self) -> bytes:
        """Return the attachment of the next message."""
        self._sequence += 1
        return struct.pack("<qqB16s", self._sequence, time.time_ns(), 16, self._gid)

    def send(self, twist: Twist) -> None:
        """Publish a command."""
        self._session.put(self.key, twist.encode(), attachment=self.attachment())

    def close(self) -> None:
        """Undeclare the token, as when the publisher is destroyed."""
        self._token.undeclare()


class PlainPeer:
    """A session with one node."""

    def __init__(self, endpoint: str) -> None:
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
        config.insert_json5("scouting/multicast/enabled", "false")
        self.session = zenoh.open(config)
        node = f"@ros2_lv/0/{self.session.info.zid()}/0/0/NN/%/%/plain_peer"
        self._node = self.session.liveliness().declare_token(node)
        self._odometry = self.session.declare_subscriber(f"0/odom/{ODOMETRY}", self._on_odometry)
        self._travel = 0.0  # m, since the start
        self._stamp_s: float | None = None

    def close(self) -> None:
        """Close the session."""
        self.session.close()

    def description(self) -> str:
        """Return the latched /robot_description."""
        arrived: queue.Queue[bytes] = queue.Queue()
        subscriber = zenoh.ext.declare_advanced_subscriber(
            self.session,
            f"0/robot_description/{TEXT}",
            lambda sample: arrived.put(sample.payload.to_bytes()),
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True),
        )
        try:
            return text(arrived.get(timeout=PATIENCE_S), 4)
        finally:
            subscriber.undeclare()

    def travel(self, act: Callable[[], None]) -> float:
        """Return how far the robot has driven, until it stands, by its odometry (m)."""
        before = self._travel
        act()
        time.sleep(HALT_S)
        return round(self._travel - before, 3)

    def _on_odometry(self, sample: zenoh.Sample) -> None:
        """Add up nav_msgs/Odometry: the speed along x, by the stamps."""
        payload = sample.payload.to_bytes()[len(CDR) :]
        seconds, nanoseconds = struct.unpack_from("<iI", payload)
        (speed,) = struct.unpack_from("<d", payload, len(payload) - SPEED_FROM_END)
        stamp_s, before_s = seconds + nanoseconds * 1e-9, self._stamp_s
        self._travel += abs(speed) * (stamp_s - before_s if before_s else 0.0)
        self._stamp_s = stamp_s

    def trigger(self, service: str) -> tuple[bool, str]:
        """Call a service of std_srvs/srv/Trigger; return success and message."""
        response = self._call(service, TRIGGER)
        return bool(response[4]), text(response, 8)

    def parameters(self, node: str) -> list[str]:
        """Return the names of a node's parameters, as ``ros2 param list`` asks for them."""
        response = self._call(f"{node}/list_parameters", LIST, struct.pack("<I4xQ", 0, 0))
        (count,), at, found = struct.unpack_from("<I", response, 4), 8, []
        for _ in range(count):
            found.append(text(response, at))
            at += 4 + len(found[-1]) + 1
            at += -at % 4
        return found

    def _call(self, service: str, about_it: str, request: bytes = b"") -> bytes:
        client = Endpoint(self.session, "SC", service, about_it)
        about = client.attachment()
        replies = self.session.get(
            client.key, payload=CDR + request, attachment=about, timeout=PATIENCE_S,
            target=zenoh.QueryTarget.ALL_COMPLETE,
        )  # fmt: skip
        for reply in replies:
            if reply.ok is not None and reply.ok.attachment is not None:
                raw = reply.ok.attachment.to_bytes()
                if raw[:8] != about[:8] or raw[17:] != about[17:]:
                    raise ValueError(f"a reply to another request: {raw.hex()}")
                return reply.ok.payload.to_bytes()
        raise TimeoutError(f"{service} does not reply")


class Driver:
    """A new node that publishes the current command at 20 Hz in a thread; None: it is silent."""

    def __init__(self, peer: PlainPeer) -> None:
        self.twist: Twist | None = None
        self.publisher = Endpoint(peer.session, *COMMANDS)
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop publishing."""
        self._ends.set()
        self._thread.join()
        self.publisher.close()

    def publish(self, twist: Twist, seconds: float = MOTION_S) -> None:
        """Publish this for a time, then nothing."""
        self.twist = twist
        time.sleep(seconds)
        self.twist = None

    def hold_key(self) -> None:
        """Publish as a keyboard: once for each press, and for each repeat by the terminal."""
        self.publisher.send(FORWARD)
        time.sleep(KEY_DELAY_S)
        for _ in range(round(MOTION_S / KEY_REPEAT_S)):
            self.publisher.send(FORWARD)
            time.sleep(KEY_REPEAT_S)

    def _run(self) -> None:
        while not self._ends.wait(PERIOD_S):
            if (twist := self.twist) is not None:
                self.publisher.send(twist)


def text(payload: bytes, at: int) -> str:
    """Return the string at an offset of a CDR payload."""
    (size,) = struct.unpack_from("<I", payload, at)
    return payload[at + 4 : at + 3 + size].decode()


def exercise(peer: PlainPeer, pause_s: float) -> dict[str, Any]:
    """Drive as each tool, stop and reset under a running node; return what was observed."""
    found: dict[str, Any] = {"zenoh": version("eclipse-zenoh"), "description": peer.description()}
    found["parameters"] = peer.parameters("/t2")
    for tool in ("topic_pub", "keyboard", "planner"):
        with closing(Driver(peer)) as node:
            drive = node.hold_key if tool == "keyboard" else partial(node.publish, FORWARD)
            found[tool] = peer.travel(drive)
            if tool == "planner":
                time.sleep(pause_s)
                found["after_pause"] = peer.travel(drive)
    with closing(Driver(peer)) as node:
        node.twist = FORWARD
        time.sleep(MOTION_S)
        found["stop"] = peer.trigger("/hardware/e_stop_trigger")
        time.sleep(HALT_S)
        found["reset"] = peer.trigger("/hardware/e_stop_reset")
        found["across_reset"] = peer.travel(lambda: time.sleep(MOTION_S))
        node.twist = None
        time.sleep(HALT_S)
        found["after_reset"] = peer.travel(lambda: node.publish(FORWARD))
    return found


if __name__ == "__main__":
    with closing(PlainPeer(sys.argv[1])) as this:
        print(json.dumps(exercise(this, float(sys.argv[2]))))
