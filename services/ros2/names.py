"""Names on the wire of rmw_zenoh: keys, liveliness tokens, QoS, rules of ROS names. Pure."""

import re
from typing import NamedTuple

from services.ros2.definitions import HASHES

LIVELINESS = "@ros2_lv"
NODE = "t2"  # the gateway
EMPTY = "%"  # an empty enclave or namespace
CHUNKS = 13  # of an endpoint's token; newer peers may append one with backends
PART = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")
QOS = "::,10:,:,:,,"  # reliable, volatile, the last 10


def qos(kept: int) -> str:
    """Return the QoS of a publisher that keeps samples for late subscribers: transient local."""
    return f":1:,{kept}:,:,:,," if kept else QOS


class Node(NamedTuple):
    """A node of one Zenoh session; its id there is 0."""

    domain: int
    zid: str
    namespace: str  # absolute
    name: str

    @property
    def token(self) -> str:
        """The node's own token."""
        return self._token(0, "NN")

    def endpoint_token(self, number: int, kind: str, topic: str, interface: str, qos: str) -> str:
        """Return the token of a publisher (MP), subscription (MS) or service (SS)."""
        about = (mangled(topic), wire_type(interface), HASHES[interface], qos)
        return "/".join([self._token(number, kind), *about])

    def _token(self, number: int, kind: str) -> str:
        where = f"{LIVELINESS}/{self.domain}/{self.zid}/0/{number}/{kind}"
        return f"{where}/{EMPTY}/{mangled(self.namespace)}/{self.name}"


def publisher(token: str) -> tuple[str, str, str] | None:
    """Return node, topic and wire type of a publisher's token, None for other tokens.

    Node and topic are absolute names.
    """
    chunks = token.split("/")
    if len(chunks) < CHUNKS or chunks[5] != "MP":
        return None
    namespace, node, topic = (chunk.replace(EMPTY, "/") for chunk in chunks[7:10])
    return absolute(namespace, node), topic, chunks[10]


def is_valid(name: str) -> bool:
    """Return whether this is an absolute ROS name, such as ``/t2/odom``, or the root ``/``."""
    return name == "/" or (name.startswith("/") and all(map(PART.match, name[1:].split("/"))))


def absolute(namespace: str, name: str) -> str:
    """Return the absolute name of a topic of a namespace; a name that begins with / stays."""
    return name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}"


def wire_type(interface: str) -> str:
    """Return the name of a type on the wire: ``pkg::msg::dds_::Type_``."""
    package, kind, name = interface.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def data_key(domain: int, topic: str, interface: str) -> str:
    """Return the key of a topic's samples, or of a service's requests."""
    return f"{domain}/{topic.strip('/')}/{wire_type(interface)}/{HASHES[interface]}"


def mangled(name: str) -> str:
    """Return a name as one chunk of a key."""
    return name.replace("/", EMPTY) if name.strip("/") else EMPTY
