"""Names on the wire of rmw_zenoh: keys, liveliness tokens, QoS, rules of ROS names. Pure."""

import re
from typing import NamedTuple

from services.ros2.rihs import HASHES

LIVELINESS = "@ros2_lv"
EMPTY = "%"  # an empty enclave or namespace
NODE_CHUNKS = 9  # of a node's token
CHUNKS = 13  # of an endpoint's token; newer peers may append one with backends
DOMAIN = re.compile(r"[0-9]{1,3}\Z", re.ASCII)
PART = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")
KINDS = {"MP": "publisher", "MS": "subscription", "SS": "service", "SC": "client"}
QOS = "::,10:,:,:,,"  # reliable, volatile, the last 10
QOS_LATCHED = ":1:,1:,:,:,,"  # transient local, the last one


class Node(NamedTuple):
    """A node of one Zenoh session; its id there is 0."""

    domain: int
    zid: str
    namespace: str  # absolute
    name: str

    @property
    def path(self) -> str:
        """The absolute name, such as ``/t2_001/t2``."""
        return absolute(self.namespace, self.name)

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


class Peer(NamedTuple):
    """One endpoint of a node, from its token."""

    zid: str
    kind: str  # publisher, subscription, service, client
    node: str  # with its namespace
    topic: str
    type: str  # such as geometry_msgs/msg/Twist
    hash: str
    qos: str


def node(token: str) -> Node | None:
    """Return the node of any token; None for other keys."""
    chunks = token.split("/")
    if len(chunks) < NODE_CHUNKS or chunks[0] != LIVELINESS or not DOMAIN.match(chunks[1]):
        return None
    return Node(int(chunks[1]), chunks[2], chunks[7].replace(EMPTY, "/"), chunks[8])


def peer(token: str) -> Peer | None:
    """Return the endpoint of a token; None for a node's, and for other keys."""
    chunks, owner = token.split("/"), node(token)
    if owner is None or len(chunks) < CHUNKS or chunks[5] not in KINDS:
        return None
    topic, wire, digest, qos = chunks[9:13]
    kind = KINDS[chunks[5]]
    return Peer(
        owner.zid, kind, owner.path, topic.replace(EMPTY, "/"), interface(wire), digest, qos
    )


def is_latched(qos: str) -> bool:
    """Return whether the durability is transient local."""
    return qos.split(":")[1:2] == ["1"]


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


def interface(wire: str) -> str:
    """Return the name of a type in ROS, such as ``geometry_msgs/msg/Twist``."""
    return wire.replace("::dds_::", "/").replace("::", "/").removesuffix("_")


def data_key(domain: int, topic: str, interface: str) -> str:
    """Return the key of a topic's samples, or of a service's requests."""
    return f"{domain}/{topic.strip('/')}/{wire_type(interface)}/{HASHES[interface]}"


def mangled(name: str) -> str:
    """Return a name as one chunk of a key."""
    return name.replace("/", EMPTY) if name.strip("/") else EMPTY
