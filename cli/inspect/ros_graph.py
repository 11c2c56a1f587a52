"""Diagnosis of the nodes of ROS 2 at the robot's router, from their liveliness tokens. Pure.

Zenoh matches keys, and type and hash are parts of a key: an endpoint with another type or hash
receives nothing, without an error on either side.
"""

from collections.abc import Iterable, Iterator

from cli.inspect import remedies
from cli.inspect.diagnosis import Finding, Observation
from services.ros2 import names
from services.ros2.names import Node, Peer

GATEWAY = "t2"
SHORT = 14  # characters of a hash that are shown
# The endpoint that each kind exchanges messages with.
COUNTERPART = {
    "publisher": "subscription", "subscription": "publisher", "client": "service"
}  # fmt: skip
VERBS = {"publisher": "publishes", "subscription": "subscribes to", "client": "calls"}


def place(settings: object) -> tuple[int, str] | None:
    """Return the domain and the namespace in a gateway's settings; None for another answer."""
    match settings:
        case {"ros2.domain": {"value": int(domain)}, "ros2.namespace": {"value": str(namespace)}}:
            return domain, namespace
    return None


def diagnose_ros(seen: Observation) -> Iterator[Finding]:
    """Report nodes of ROS 2; nothing where neither a node nor the gateway is."""
    nodes = sorted({node for token in seen.ros_tokens if (node := names.node(token))})
    if "ros2" not in seen.instances:
        if nodes:
            text = f"the gateway is not running; nodes of ROS 2 are here: {_listed(nodes)}"
            yield Finding("ros", "wrong", text, remedies.ROS_GATEWAY)
        return
    if seen.ros_place is None:
        yield Finding("ros", "unknown", "the gateway does not return its settings")
        return
    domain, namespace = seen.ros_place
    path = names.absolute(namespace, GATEWAY)
    own = {node.zid for node in nodes if node.domain == domain and node.path == path}
    if not own:
        yield Finding("ros", "unknown", "the gateway's tokens are not visible", remedies.ROS_HIDDEN)
        return
    if len(own) > 1:
        text = f"{len(own)} nodes are called {path}: a second gateway has its name and domain"
        yield Finding("ros", "wrong", text, remedies.ROS_TWICE)
    others = [node for node in nodes if node.zid not in own]
    yield from _nodes(others, domain)
    here = [token for token in seen.ros_tokens if _is_on(token, domain)]
    peers = [peer for token in here if (peer := names.peer(token))]
    ours = [peer for peer in peers if peer.zid in own]
    theirs = [peer for peer in peers if peer.zid not in own]
    for peer in theirs:
        yield from _endpoint(peer, ours)


def _nodes(others: list[Node], domain: int) -> Iterator[Finding]:
    """Report the nodes of the gateway's domain, and those of others."""
    here = [node for node in others if node.domain == domain]
    if here:
        yield Finding("ros", "ok", f"nodes on domain {domain}: {_listed(here)}")
    elif not others:
        text = f"the gateway is on domain {domain}, without any other node"
        yield Finding("ros", "note", text, remedies.ROS_NO_NODE)
    for other in sorted({node.domain for node in others} - {domain}):
        there = [node for node in others if node.domain == other]
        text = f"nodes on domain {other}, the gateway is on {domain}: {_listed(there)}"
        yield Finding("ros", "wrong", text, remedies.ROS_DOMAIN)


def _endpoint(peer: Peer, ours: list[Peer]) -> Iterator[Finding]:
    """Report why an endpoint exchanges nothing, or not everything, with the gateway."""
    wanted = COUNTERPART.get(peer.kind)
    match = [own for own in ours if own.topic == peer.topic and own.kind == wanted]
    if not match:
        return
    what = f"{peer.node} {VERBS[peer.kind]} {peer.topic}"
    same_type = [own for own in match if own.type == peer.type]
    if not same_type:
        types = " or ".join(sorted(own.type for own in match))
        text = f"{what} as {peer.type}, the gateway has {types}: nothing arrives"
        yield Finding("ros", "wrong", text, remedies.ROS_TYPE)
    elif all(own.hash != peer.hash for own in same_type):
        hashes = f"{peer.hash[:SHORT]} instead of {same_type[0].hash[:SHORT]}"
        text = f"{what} with type hash {hashes}: nothing arrives"
        yield Finding("ros", "wrong", text, remedies.ROS_HASH)


def _is_on(token: str, domain: int) -> bool:
    node = names.node(token)
    return node is not None and node.domain == domain


def _listed(nodes: Iterable[Node]) -> str:
    return ", ".join(sorted({node.path for node in nodes}))
