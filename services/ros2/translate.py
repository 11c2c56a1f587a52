"""Messages of the bus as messages of ROS 2, in the form of ``cdr``. Pure.

Frames follow REP-103 and REP-105; a stamp is the wall clock of the robot. A range that was not
measured becomes the value that ROS defines for its reason.
"""

import math
from collections.abc import Mapping

from common.freshness import NS_PER_S
from common.settings import Mount, Vehicle, sonar_mounts
from common.text import printable
from services.ros2.cdr import Value
from services.ros2.config import Ros2Config
from t2 import messages as m

ULTRASOUND = 0
SONAR_HEIGHT, BODY_HEIGHT, CLEARANCE = 0.35, 0.35, 0.15  # m, for display: the settings have none
PLANAR = 1e-6  # variance of what a vehicle on a floor does not do: z, roll, pitch, sideways
OK, WARN, ERROR, STALE = 0, 1, 2, 3
SEVERITIES: Mapping[int, int] = {OK: 20, WARN: 30}  # INFO, WARN of a log
STALE_NS = 3 * NS_PER_S
ONCE = "t2: cmd_vel"  # noted on a change, not periodically
WORST: Mapping[str, int] = {"run": OK, "slow": WARN, "stop": WARN, "brake": ERROR}


def header(t_ns: int, frame: str) -> Value:
    """Return a std_msgs/Header."""
    return divmod(t_ns, NS_PER_S), frame


def turned(yaw: float) -> Value:
    """Return the quaternion of a heading (rad)."""
    return 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)


def odometry(message: m.Odometry, prefix: str) -> Value:
    """Return a nav_msgs/Odometry: the pose in ``odom``, the twist in ``base_link``."""
    pose = (message.x, message.y, 0.0), turned(message.heading)
    twist = (message.linear, 0.0, 0.0), (0.0, 0.0, message.angular)
    return (
        header(message.t_ns, prefix + message.frame_id),
        prefix + message.child_frame_id,
        (pose, spread(message.pose_covariance, (0, 1, 5))),
        (twist, spread(message.twist_covariance, (0, 5))),
    )


def spread(covariance: tuple[float, ...], axes: tuple[int, ...]) -> tuple[float, ...]:
    """Return the 6x6 covariance over x, y, z, roll, pitch, yaw of one over some axes."""
    full = [0.0] * 36
    for axis in range(6):
        full[7 * axis] = PLANAR
    for row, to_row in enumerate(axes):
        for column, to_column in enumerate(axes):
            full[6 * to_row + to_column] = covariance[len(axes) * row + column]
    return tuple(full)


def map_pose(message: m.MapPose, t_ns: int) -> Value | None:
    """Return a geometry_msgs/PoseWithCovarianceStamped in ``map``; None without a pose."""
    x, y, heading, covariance = message.x, message.y, message.heading, message.pose_covariance
    if x is None or y is None or heading is None or covariance is None:
        return None
    pose = (x, y, 0.0), turned(heading)
    return header(t_ns, message.frame_id), (pose, spread(covariance, (0, 1, 5)))


def map_transform(message: m.MapPose, t_ns: int, prefix: str) -> Value | None:
    """Return a tf2_msgs/TFMessage from ``map`` to ``odom``; None without a pose.

    ``map`` has no prefix: robots share it.
    """
    if (origin := message.odom) is None:
        return None
    where = (origin.x, origin.y, 0.0), turned(origin.heading)
    return (((header(t_ns, message.frame_id), f"{prefix}odom", where),),)


def transform(message: m.Odometry, prefix: str) -> Value:
    """Return a tf2_msgs/TFMessage from ``odom`` to ``base_link``."""
    where = (message.x, message.y, 0.0), turned(message.heading)
    stamped = header(message.t_ns, prefix + message.frame_id)
    return (((stamped, prefix + message.child_frame_id, where),),)


def static_transforms(t_ns: int, vehicle: Vehicle, prefix: str) -> Value:
    """Return a tf2_msgs/TFMessage from ``base_link`` to the sonars."""
    stamped = header(t_ns, f"{prefix}base_link")
    transforms = []
    for mount in sonar_mounts(vehicle):
        where = (mount.x, mount.y, SONAR_HEIGHT), turned(mount.yaw)
        transforms.append((stamped, prefix + sonar_frame(mount), where))
    return (tuple(transforms),)


def description(vehicle: Vehicle, prefix: str) -> str:
    """Return the URDF: the body as a box. The board reports no angles of wheels."""
    size = f"{vehicle.length} {vehicle.width} {BODY_HEIGHT}"
    return f"""<?xml version="1.0"?>
<robot name="t2">
  <link name="{prefix}base_link">
    <visual>
      <origin xyz="0 0 {CLEARANCE + BODY_HEIGHT / 2}" rpy="0 0 0"/>
      <geometry><box size="{size}"/></geometry>
    </visual>
  </link>
</robot>
"""


def sonar_frame(mount: Mount) -> str:
    """Return the frame of a sonar: its x axis is the beam."""
    return f"sonar_{mount.name}"


def sonar_range(
    message: m.Ultrasonic, index: int, mount: Mount, config: Ros2Config, *, doubted: bool
) -> Value:
    """Return a sensor_msgs/Range of one sonar; one that safety doubts is faulty.

    Nearer than can be measured is ``min_range``. Nav2's collision monitor stops for a range over
    ``max_range``, and passes NaN as free space; REP 117 has NaN for a fault, and +Inf for no echo.
    """
    settings, vehicle = config.ros2, config.vehicle
    measured, reason = message.ranges[index], "fault" if doubted else message.status[index]
    if measured is None or doubted:
        is_for_nav2 = settings.no_echo == "max_range"
        far, fault = (vehicle.sonar_max, math.inf) if is_for_nav2 else (math.inf, math.nan)
        by_status = {"no_echo": far, "too_near": vehicle.sonar_min}
        measured = by_status.get(reason, fault)
    stamped = header(message.t_ns, settings.frame_prefix + sonar_frame(mount))
    limits = vehicle.sonar_min, vehicle.sonar_max
    return stamped, ULTRASOUND, settings.sonar_fov, *limits, measured, 0.0


def status(level: int, name: str, text: str, values: Mapping[str, object]) -> Value:
    """Return a diagnostic_msgs/DiagnosticStatus of this robot."""
    pairs = tuple((printable(key), printable(str(value))) for key, value in values.items())
    return level, f"t2: {printable(name)}", printable(text), "t2", pairs


def log(t_ns: int, level: int, text: str) -> Value:
    """Return a rcl_interfaces/Log of the gateway's node."""
    return divmod(t_ns, NS_PER_S), SEVERITIES[level], "t2", printable(text), "", "", 0


def safety_status(state: m.SafetyState) -> Value:
    """Return the status of safety: why the vehicle may or may not move."""
    values = {
        "verdict": state.verdict,
        "source": state.source or "none",
        "latched": ", ".join(state.latched) or "none",
        "linear limit": state.limits.forward,
        **{f"cause {cause.name}": cause.text for cause in state.causes},
    }
    stops = {cause.name for cause in state.causes if cause.action != "slow"}
    level = OK if stops == {"no_request"} else WORST.get(state.verdict, ERROR)  # OK: it is idle
    return status(level, "safety", state.text, values)


def link_status(link: m.Link) -> Value:
    """Return the status of the link to the main board."""
    texts = {"up": "The board answers.", "lost": "The board is silent.", "never": "No board yet."}
    values = {"board": link.board, "armed": link.armed, "waiting": link.waiting}
    level = OK if link.state == "up" and link.armed else WARN if link.state == "up" else ERROR
    return status(level, "link", texts[link.state], values)


def driver_status(side: str, driver: m.Driver) -> Value:
    """Return the status of a motor driver."""
    faults = ", ".join(driver.faults)
    text = f"Faults: {faults}." if faults else "No faults."
    return status(ERROR if faults else OK, f"{side} motor driver", text, {"bits": driver.bits})


def health_status(service: str, health: m.Health) -> Value:
    """Return the status of a service by its health message."""
    values = {"version": health.version, "uptime": f"{health.uptime:.0f} s", **health.counters}
    return status(OK, f"service {service}", "It runs.", values)


class Diagnostics:
    """The newest diagnostic status of each part; a silent part is stale."""

    def __init__(self) -> None:
        self._statuses: dict[str, tuple[Value, int]] = {}

    def note(self, status: Value, now_ns: int) -> None:
        """Replace the status of the same name."""
        self._statuses[status[1]] = (status, now_ns)

    def statuses(self, now_ns: int) -> tuple[Value, ...]:
        """Return all statuses, the silent ones as stale."""
        return tuple(
            (STALE, name, f"Silent. Last: {status[2]}", *status[3:])
            if now_ns - noted_ns > STALE_NS and name != ONCE
            else status
            for name, (status, noted_ns) in sorted(self._statuses.items())
        )
