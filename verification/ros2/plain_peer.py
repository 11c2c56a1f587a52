"""A ROS 2 node on plain Zenoh, written from the description of rmw_zenoh's wire.

``python plain_peer.py tcp/HOST:PORT`` runs ``exercise`` and prints its results as JSON. It imports
nothing of T2, so that it runs with any version of Zenoh. Poses are in ``odom``; SI units.
"""

import json
import queue
import struct
import sys
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from typing import Any, NamedTuple

import xxhash
import zenoh

PATIENCE_S = 15.0
PERIOD_S = 0.05
NEUTRAL_S = 1.0  # a publisher is taken when its delay has been steady
MOTION_S = 1.5
SPEED_MPS = 0.3

ODOMETRY = (
    "nav_msgs::msg::dds_::Odometry_/"
    "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"
)
TWIST = (
    "geometry_msgs::msg::dds_::TwistStamped_/"
    "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"
)
TEXT = (
    "std_msgs::msg::dds_::String_/"
    "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
)
TRIGGER = (
    "std_srvs::srv::dds_::Trigger_/"
    "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
)
QOS = "::,10:,:,:,,"
CDR = b"\0\1\0\0"
FRAME = b"base_link\0"

Pose = tuple[float, float]  # x, y


class Twist(NamedTuple):
    """A command."""

    linear: float = 0.0
    angular: float = 0.0
    lateral: float = 0.0

    def encode(self) -> bytes:
        """Return a geometry_msgs/TwistStamped with a zero stamp."""
        axes = self.linear, self.lateral, 0.0, 0.0, 0.0, self.angular
        return CDR + struct.pack("<iII10s2x6d", 0, 0, len(FRAME), FRAME, *axes)


class Endpoint:
    """A publisher or client: its liveliness token, and its attachments."""

    def __init__(self, session: zenoh.Session, number: int, kind: str, name: str, about: str):
        zid = session.info.zid()
        mangled = name.replace("/", "%")
        token = f"@ros2_lv/0/{zid}/0/{number}/{kind}/%/%/plain_peer/{mangled}/{about}/{QOS}"
        self.gid = xxhash.xxh3_128_digest(token.encode())[::-1]
        self.key = f"0/{name.strip('/')}/{about}"
        self.sequence = 0
        self._token = session.liveliness().declare_token(token)

    def attachment(self) -> bytes:
        """Return the attachment of the next message."""
        self.sequence += 1
        return struct.pack("<qqB16s", self.sequence, time.time_ns(), 16, self.gid)

    def close(self) -> None:
        """Undeclare the token, as when the publisher is destroyed."""
        self._token.undeclare()


class PlainPeer:
    """A session with one node; its publisher of commands appears with the first command."""

    def __init__(self, endpoint: str) -> None:
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
        config.insert_json5("scouting/multicast/enabled", "false")
        self.session = zenoh.open(config)
        zid = self.session.info.zid()
        node = f"@ros2_lv/0/{zid}/0/0/NN/%/%/plain_peer"
        self._node = self.session.liveliness().declare_token(node)
        self._number = 0

    def close(self) -> None:
        """Close the session: all its tokens disappear."""
        self.session.close()

    def endpoint(self, kind: str, name: str, about: str) -> Endpoint:
        """Declare a publisher (MP) or client (SC)."""
        self._number += 1
        return Endpoint(self.session, self._number, kind, name, about)

    def tokens(self) -> list[str]:
        """Return the liveliness tokens of all nodes and endpoints."""
        replies = self.session.liveliness().get("@ros2_lv/0/**", timeout=PATIENCE_S)
        return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]

    def commands(self, about: str = TWIST) -> Endpoint:
        """Declare a publisher of commands; ``about`` is another type and hash."""
        return self.endpoint("MP", "/cmd_vel", about)

    def send(self, publisher: Endpoint, twist: Twist, *, blocks: bool = False) -> None:
        """Publish a command; with ``blocks`` it waits for space, as reliable publishers of ROS."""
        control = zenoh.CongestionControl.BLOCK if blocks else zenoh.CongestionControl.DROP
        self.session.put(
            publisher.key, twist.encode(), attachment=publisher.attachment(),
            congestion_control=control,
        )  # fmt: skip

    def repeat(self, publisher: Endpoint, twist: Twist, seconds: float) -> None:
        """Publish a command at 20 Hz."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            self.send(publisher, twist)
            time.sleep(PERIOD_S)

    def drive(self, publisher: Endpoint, twist: Twist, seconds: float) -> None:
        """Publish neutral commands, then this one, then neutral ones."""
        self.repeat(publisher, Twist(), NEUTRAL_S)
        self.repeat(publisher, twist, seconds)
        self.repeat(publisher, Twist(), NEUTRAL_S)

    def pose(self) -> Pose:
        """Return the next pose of /odom."""
        arrived: queue.Queue[bytes] = queue.Queue()
        key = f"0/odom/{ODOMETRY}"
        subscriber = self.session.declare_subscriber(
            key, lambda sample: arrived.put(sample.payload.to_bytes())
        )
        try:
            return decoded_pose(arrived.get(timeout=PATIENCE_S))
        finally:
            subscriber.undeclare()

    def description(self) -> str:
        """Return the latched /robot_description."""
        arrived: queue.Queue[bytes] = queue.Queue()
        subscriber = _latched(
            self.session,
            f"0/robot_description/{TEXT}",
            lambda sample: arrived.put(sample.payload.to_bytes()),
        )
        try:
            return text(arrived.get(timeout=PATIENCE_S), 4)[0]
        finally:
            subscriber.undeclare()

    def call(self, service: str) -> tuple[bool, str]:
        """Call a service of std_srvs/srv/Trigger; return success and message."""
        client = self.endpoint("SC", service, TRIGGER)
        about = client.attachment()
        for reply in self._replies(client.key, about):
            raw = reply.attachment.to_bytes()
            if raw[:8] != about[:8] or raw[17:] != about[17:]:
                raise ValueError(f"a reply to another request: {raw.hex()}")
            payload = reply.payload.to_bytes()
            return bool(payload[4]), text(payload, 8)[0]
        raise TimeoutError(f"{service} does not reply")

    def _replies(self, key: str, about: bytes) -> Iterator[Any]:
        target = zenoh.QueryTarget.ALL_COMPLETE
        for reply in self.session.get(
            key, payload=CDR, attachment=about, target=target, timeout=PATIENCE_S
        ):
            if reply.ok is not None:
                yield reply.ok


def _latched(session: zenoh.Session, key: str, take: Callable[[Any], None]) -> Any:
    """Declare the subscriber of a transient local topic."""
    import zenoh.ext

    history = zenoh.ext.HistoryConfig(detect_late_publishers=True)
    return zenoh.ext.declare_advanced_subscriber(session, key, take, history=history)


def decoded_pose(payload: bytes) -> Pose:
    """Return x and y of a nav_msgs/Odometry."""
    _, at = text(payload, 12)
    _, at = text(payload, at)
    at += -(at - 4) % 8
    x, y, *_ = struct.unpack_from("<7d", payload, at)
    return x, y


def text(payload: bytes, at: int) -> tuple[str, int]:
    """Return the string at an offset, aligned to 4, and the offset behind it."""
    at += -at % 4
    (size,) = struct.unpack_from("<I", payload, at)
    at += 4
    return payload[at : at + size - 1].decode(), at + size


def exercise(peer: PlainPeer) -> dict[str, Any]:
    """Read, drive, stop, try to drive, reset; return what was observed."""
    found: dict[str, Any] = {"zenoh": version("eclipse-zenoh")}
    found["description"] = peer.description()
    publisher, forward = peer.commands(), Twist(SPEED_MPS)
    found["poses"] = [peer.pose()]
    peer.drive(publisher, forward, MOTION_S)
    found["poses"].append(peer.pose())
    found["stop"] = peer.call("/hardware/e_stop_trigger")
    peer.drive(publisher, forward, MOTION_S)
    found["poses"].append(peer.pose())
    found["reset"] = peer.call("/hardware/e_stop_reset")
    return found


def main() -> None:
    """Print the results of ``exercise`` as JSON."""
    peer = PlainPeer(sys.argv[1])
    try:
        print(json.dumps(exercise(peer)))
    finally:
        peer.close()


if __name__ == "__main__":
    main()
