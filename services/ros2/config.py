"""Settings of the gateway to ROS 2."""

from typing import Annotated, Literal

from msgspec import Meta

from common import settings
from common.settings import allowed
from services.ros2.names import is_valid

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


class Ros2Config(settings.Shared, frozen=True, kw_only=True):
    """All sections that the gateway reads."""

    ros2: Ros2 = Ros2()
    vehicle: settings.Vehicle = settings.Vehicle()
