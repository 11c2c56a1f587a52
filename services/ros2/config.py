"""Settings of the gateway to ROS 2."""

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from common import settings
from common.settings import SourceName, allowed
from services.ros2.names import absolute, is_valid

MAP_POSE = "map_pose"  # topic of our own pose in the map

Frame = Annotated[str, Meta(pattern=r"^([A-Za-z_][A-Za-z0-9_/]*)?\Z", max_length=60)]


class Ros2(settings.Section, frozen=True, kw_only=True):
    """What ROS nodes see, and which commands are taken."""

    domain: Annotated[int, Meta(ge=0, le=232)] = 0  # ROS_DOMAIN_ID
    namespace: str = "/"  # of the node and its topics, such as /t2_001
    frame_prefix: Frame = ""  # before odom, base_link and the sonars, such as t2_001/
    cmd_vel: Literal["stamped", "twist", "both"] = (
        "stamped"  # its type; both confuse ros2 topic echo
    )
    neutral: Literal["silence", "zero"] = "silence"  # what a publisher does before motion, 0.5 s
    publish_tf: bool = True  # odom to base_link; false for users of another estimator
    # map to odom; true only where no node of ROS publishes it, as AMCL does
    publish_map_tf: bool = False
    # poses that ROS nodes measure, by source of localization, as amcl = "/amcl_pose"
    fixes: Annotated[dict[SourceName, str], Meta(max_length=8)] = msgspec.field(
        default_factory=dict
    )
    no_echo: Literal["max_range", "inf"] = (
        "max_range"  # without an echo; a fault is +Inf then, otherwise NaN
    )
    sonar_fov: Annotated[float, allowed("rad", gt=0.0, le=3.2)] = 0.5  # the whole opening

    def __post_init__(self) -> None:
        if not is_valid(self.namespace):
            raise ValueError(
                f"namespace is {self.namespace!r}, allowed is / or a name such as /t2_001: "
                "letters, digits and _, not beginning with a digit"
            )
        if self.publish_map_tf and not self.publish_tf:
            raise ValueError(
                "publish_map_tf needs publish_tf: the transform ends at the robot's own odom, "
                "and another estimator's is elsewhere"
            )
        self._check_fixes()

    def _check_fixes(self) -> None:
        topics = [absolute(self.namespace, topic) for topic in self.fixes.values()]
        for source, topic in zip(self.fixes, topics, strict=True):
            if topic == "/" or not is_valid(topic):
                raise ValueError(f"fixes.{source} is {topic!r}, allowed is a topic: /amcl_pose")
            if topic == absolute(self.namespace, MAP_POSE):
                raise ValueError(f"fixes.{source}: {topic} is the robot's own pose, and no fix")
            if topics.count(topic) > 1:
                raise ValueError(f"fixes names {topic} twice: each pose would count twice")


class Ros2Config(settings.Shared, frozen=True, kw_only=True):
    """All sections that the gateway reads."""

    ros2: Ros2 = Ros2()
    vehicle: settings.Vehicle = settings.Vehicle()
    # of another service, which checks it: only the names of its sources count here
    localization: dict[str, Any] = msgspec.field(default_factory=dict)

    def __post_init__(self) -> None:
        sources = self.localization.get("sources")
        known = sources if isinstance(sources, dict) else {}
        for source in self.ros2.fixes:
            if source not in known:
                raise ValueError(
                    f"ros2.fixes names {source!r}, which localization.sources does not list; add "
                    f"there: {source} = {{ sigma = 0.1 }}"
                )
