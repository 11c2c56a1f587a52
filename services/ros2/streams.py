"""Streams of the bus as topics of ROS 2."""

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from common import clock
from common.bus.bus import Arrival
from common.freshness import NS_PER_S, Latest
from common.service import Node
from common.settings import sonar_mounts
from services.ros2 import translate
from services.ros2.cdr import Value
from services.ros2.config import MAP_POSE, Ros2Config
from services.ros2.endpoints import Publisher
from services.ros2.fixes import POSE, PublishedOdometry
from t2 import keys
from t2 import messages as m

SIDES = ("left", "right")
Declare = Callable[..., Publisher]  # topic, interface, samples kept for late subscribers
BOOL, TRANSFORMS = "std_msgs/msg/Bool", "tf2_msgs/msg/TFMessage"
QUEUED = 8  # samples of odometry: a loop that is up to 0.3 s late loses none
SONAR_HZ = 10.0  # at most, of each
BUMPER_HZ = 10.0  # at most; a change is passed on at once
EARLY = 0.25  # of a period: arrivals jitter
DIAGNOSTICS_S = 1.0


class Streams:
    """Subscribes to the robot's streams and publishes them."""

    def __init__(
        self, node: Node[Ros2Config], publisher: Declare, diagnostics: translate.Diagnostics
    ) -> None:
        self._state: Latest[m.SafetyState] | None = None
        self._node, self._publisher, self._diagnostics = node, publisher, diagnostics
        self._settings = settings = node.config.ros2
        self.odometry = PublishedOdometry()
        tf = self._publisher("/tf", TRANSFORMS) if settings.publish_tf else None
        self._motion(tf)
        self._map(tf if settings.publish_map_tf else None)
        self._sonars()
        self._stops()
        self._statuses()
        self._description()

    def state(self, since_ns: int) -> m.SafetyState | None:
        """Return safety's newest state, if it was received since then (monotonic)."""
        newest = self._state
        return newest.value if newest and newest.received_ns >= since_ns else None

    def _motion(self, tf: Publisher | None) -> None:
        prefix = self._settings.frame_prefix
        odometry = self._publisher("odom", "nav_msgs/msg/Odometry")

        def publish(arrival: Arrival[m.Odometry]) -> None:
            message = arrival.message
            odometry.put(translate.odometry(message, prefix))
            if tf:
                tf.put(translate.transform(message, prefix))
            self.odometry.note(message, clock.now_ns())

        self._node.bus.subscribe(keys.ODOMETRY, publish, depth=QUEUED)

    def _map(self, tf: Publisher | None) -> None:
        """Publish the pose in the map with the stamp of the odometry that it follows from.

        So tf2 finds ``map`` to ``odom`` and ``odom`` to ``base_link`` at the same times. A pose of
        odometry that was not published has no stamp, and is skipped.
        """
        poses, prefix = self._publisher(MAP_POSE, POSE), self._settings.frame_prefix
        last: m.Odometry | None = None

        def publish(arrival: Arrival[m.MapPose]) -> None:
            nonlocal last
            message = arrival.message
            odometry = self.odometry.find(message.odom_boot, message.odom_seq)
            if odometry is None or odometry is last:  # tf2 refuses a stamp that comes twice
                return
            last = odometry
            if pose := translate.map_pose(message, odometry.t_ns):
                poses.put(pose)
            transform = translate.map_transform(message, odometry.t_ns, prefix)
            if tf and transform:
                tf.put(transform)

        self._node.bus.subscribe(keys.MAP_POSE, publish)

    def _sonars(self) -> None:
        config = self._node.config
        mounts = sonar_mounts(config.vehicle)
        topics = [f"{translate.sonar_frame(mount)}/range" for mount in mounts]
        sonars = [self._publisher(topic, "sensor_msgs/msg/Range") for topic in topics]

        def publish(message: m.Ultrasonic) -> None:
            doubted = self._state.value.doubted_sonars if self._state else ()
            for index, (sonar, mount) in enumerate(zip(sonars, mounts, strict=True)):
                is_doubted = mount.name in doubted
                made = translate.sonar_range(message, index, mount, config, doubted=is_doubted)
                sonar.put(made)

        self._thin(keys.ULTRASONIC, SONAR_HZ, publish)

    def _stops(self) -> None:
        bumper = self._publisher("bumper", BOOL)
        self._thin(
            keys.BUMPER, BUMPER_HZ, lambda it: bumper.put((it.pressed,)), lambda it: it.pressed
        )
        stopped = self._publisher("hardware/e_stop", BOOL, kept=1)

        def publish(arrival: Arrival[m.SafetyState]) -> None:
            before, latched = self._state, bool(arrival.message.latched)
            self._state = Latest(arrival.message, arrival.received_ns)
            if before is None or bool(before.value.latched) != latched:
                stopped.put((latched,))

        self._node.bus.subscribe(keys.SAFETY, publish)

    def _statuses(self) -> None:
        self._note(keys.SAFETY, translate.safety_status)
        self._note(keys.LINK, translate.link_status)
        for name in keys.SERVICES:  # anybody can invent a name
            self._note(keys.HEALTH, partial(translate.health_status, name), service=name)
        for side in SIDES:
            self._note(keys.DRIVER, partial(translate.driver_status, side), side=side)
        array = self._publisher("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")

        def publish(now_ns: int) -> None:
            stamp = translate.header(time.time_ns(), "")
            array.put((stamp, self._diagnostics.statuses(now_ns)))

        self._node.loop.every(DIAGNOSTICS_S, publish)

    def _description(self) -> None:
        vehicle, prefix = self._node.config.vehicle, self._settings.frame_prefix
        description = self._publisher("robot_description", "std_msgs/msg/String", kept=1)
        description.put((translate.description(vehicle, prefix),))
        static = self._publisher("/tf_static", TRANSFORMS, kept=1)
        static.put(translate.static_transforms(time.time_ns(), vehicle, prefix))

    def _thin(
        self,
        topic: keys.Topic[Any],
        rate: float,
        publish: Callable[[Any], None],
        value: Callable[[Any], object] = lambda _: None,
    ) -> None:
        """Publish messages of a faster stream at this rate (Hz); one with another value at once.

        The times at which one is due do not follow from the arrivals, which jitter: so the rate is
        exact.
        """
        period_ns = NS_PER_S / rate
        due_ns, last = 0.0, None

        def take(arrival: Arrival[Any]) -> None:
            nonlocal due_ns, last
            now_ns, now = arrival.received_ns, value(arrival.message)
            is_due = now_ns >= due_ns - EARLY * period_ns
            if is_due:
                due_ns = max(due_ns, now_ns - EARLY * period_ns) + period_ns
            if is_due or now != last:
                last = now
                publish(arrival.message)

        self._node.bus.subscribe(topic, take)

    def _note(self, topic: keys.Topic[Any], status: Callable[[Any], Value], **names: Any) -> None:
        """Note the diagnostic status of each message."""

        def note(arrival: Arrival[Any]) -> None:
            self._diagnostics.note(status(arrival.message), arrival.received_ns)

        self._node.bus.subscribe(topic, note, depth=32, **names)
