"""A ROS 2 node of zenoh-ros2-sdk, an implementation that is not ours."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceClient, ROS2Subscriber
from zenoh_ros2_sdk.session import ZenohSession

from tests.ros2 import oracle

LATCHED = ":1:,1:,:,:,,"
POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TRIGGER = "bool success\nstring message"
PERIOD_S = 0.05
PAUSE_S, DRIVE_S = 0.7, 1.2


class RosPeer:
    """Subscriptions, publishers and clients of one Zenoh session."""

    def __init__(self, endpoint: str) -> None:
        ZenohSession._instance = None
        self._port = int(endpoint.rpartition(":")[2])
        self._open: list[Any] = []

    def subscribe(self, topic: str, interface: str, qos: str | None = None) -> list[Any]:
        """Return the list that fills with the messages of a topic."""
        came: list[Any] = []
        self._open.append(
            ROS2Subscriber(
                topic=topic, msg_type=interface, callback=came.append, qos=qos,
                msg_definition=definition(interface), type_hash=oracle.STORE.hash_rihs01(interface),
                router_port=self._port,
            )
        )  # fmt: skip
        return came

    def commands(self, interface: str, topic: str = "/cmd_vel") -> "CommandPublisher":
        """Return a publisher of commands."""
        made = ROS2Publisher(
            topic=topic, msg_type=interface, msg_definition=definition(interface),
            type_hash=oracle.STORE.hash_rihs01(interface), router_port=self._port,
        )  # fmt: skip
        self._open.append(made)
        return CommandPublisher(made, interface)

    def poses(self, topic: str) -> Any:
        """Return a publisher of poses, as a localizer's."""
        made = ROS2Publisher(
            topic=topic, msg_type=POSE, msg_definition=definition(POSE),
            type_hash=oracle.STORE.hash_rihs01(POSE), router_port=self._port,
        )  # fmt: skip
        self._open.append(made)
        return made

    def trigger(self, service: str, type_hash: str) -> Any:
        """Call a Trigger service; return the response."""
        client = ROS2ServiceClient(
            service_name=service, srv_type="std_srvs/srv/Trigger", request_definition="",
            response_definition=TRIGGER, type_hash=type_hash, router_port=self._port,
        )  # fmt: skip
        self._open.append(client)
        return client.call()

    def close(self) -> None:
        """End all."""
        for each in self._open:
            each.close()
        ZenohSession.get_instance().close()
        ZenohSession._instance = None


class CommandPublisher:
    """Publishes Twist or TwistStamped at 20 Hz."""

    def __init__(self, publisher: Any, interface: str) -> None:
        self._publisher = publisher
        self._stamped = interface.endswith("Stamped")

    def restart(self, linear: float, angular: float = 0.0) -> None:
        """Pause, then drive as ``ros2 topic pub``: without a zero before."""
        time.sleep(PAUSE_S)
        self.send(DRIVE_S, linear, angular)

    def send(self, seconds: float, linear: float = 0.0, angular: float = 0.0) -> None:
        """Send the command again and again for this time."""
        vector = oracle.STORE.types["geometry_msgs/msg/Vector3"]
        twist: Any = oracle.STORE.types["geometry_msgs/msg/Twist"](
            linear=vector(x=linear, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=angular)
        )
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            if self._stamped:
                self._publisher.publish(header=header(), twist=twist)
            else:
                self._publisher.publish(linear=twist.linear, angular=twist.angular)
            time.sleep(PERIOD_S)


@contextmanager
def peer(endpoint: str) -> Iterator[RosPeer]:
    """Connect a node, and end it."""
    made = RosPeer(endpoint)
    try:
        yield made
    finally:
        made.close()


def definition(interface: str) -> str:
    """Return the text of a message's definition."""
    return oracle.STORE.generate_msgdef(interface, ros_version=2)[0]


def header() -> Any:
    """Return a header without stamp, as many publishers send it."""
    time_type = oracle.STORE.types["builtin_interfaces/msg/Time"]
    stamped = oracle.STORE.types["std_msgs/msg/Header"]
    return stamped(stamp=time_type(sec=0, nanosec=0), frame_id="")
