"""A ROS 2 node on plain Zenoh, written from the description of rmw_zenoh's wire.

``python plain_peer.py tcp/HOST:PORT`` runs ``exercise`` and prints its results as JSON. It imports
nothing of T2, so that it runs with any version of Zenoh. SI units.
"""

import itertools
import json
import queue
import struct
import sys
import threading
import time
from contextlib import closing
from importlib.metadata import version
from typing import Any, NamedTuple

import xxhash
import zenoh
import zenoh.ext

PATIENCE_S = 15.0
PERIOD_S = 0.05
NEUTRAL_S = 1.0  # a publisher is taken when its delay has been steady
MOTION_S = 1.5

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

    def call(self, service: str) -> tuple[bool, str]:
        """Call a service of std_srvs/srv/Trigger; return success and message."""
        client = Endpoint(self.session, "SC", service, TRIGGER)
        about = client.attachment()
        replies = self.session.get(
            client.key, payload=CDR, attachment=about, target=zenoh.QueryTarget.ALL_COMPLETE,
            timeout=PATIENCE_S,
        )  # fmt: skip
        for reply in replies:
            if reply.ok is not None and reply.ok.attachment is not None:
                raw = reply.ok.attachment.to_bytes()
                if raw[:8] != about[:8] or raw[17:] != about[17:]:
                    raise ValueError(f"a reply to another request: {raw.hex()}")
                payload = reply.ok.payload.to_bytes()
                return bool(payload[4]), text(payload, 8)
        raise TimeoutError(f"{service} does not reply")


class Driver:
    """Publishes the current command at 20 Hz in a thread."""

    def __init__(self, peer: PlainPeer) -> None:
        self.twist = Twist()
        self._publisher = Endpoint(peer.session, *COMMANDS)
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop publishing."""
        self._ends.set()
        self._thread.join()
        self._publisher.close()

    def _run(self) -> None:
        while not self._ends.wait(PERIOD_S):
            self._publisher.send(self.twist)


def text(payload: bytes, at: int) -> str:
    """Return the string at an offset of a CDR payload."""
    (size,) = struct.unpack_from("<I", payload, at)
    return payload[at + 4 : at + 3 + size].decode()


def exercise(peer: PlainPeer) -> dict[str, Any]:
    """Read, drive, stop, try to drive, reset; return what was observed."""
    found: dict[str, Any] = {"zenoh": version("eclipse-zenoh"), "description": peer.description()}
    driver = Driver(peer)
    for result, service in (("stop", "e_stop_trigger"), ("reset", "e_stop_reset")):
        for twist, seconds in ((Twist(), NEUTRAL_S), (FORWARD, MOTION_S), (Twist(), NEUTRAL_S)):
            driver.twist = twist
            time.sleep(seconds)
        found[result] = peer.call(f"/hardware/{service}")
    driver.close()
    return found


if __name__ == "__main__":
    with closing(PlainPeer(sys.argv[1])) as this:
        print(json.dumps(exercise(this)))
