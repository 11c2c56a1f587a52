"""The robot's description (URDF) from ``[vehicle]``: body, four steered wheels, eight sonars. Pure.

The board reports no angles of wheels, so all joints are fixed. Heights and the wheels' size are for
display: the settings have none.
"""

from collections.abc import Iterator
from xml.sax.saxutils import quoteattr

from common.settings import Vehicle, sonar_mounts
from services.ros2.translate import sonar_frame

BODY_HEIGHT, CLEARANCE, WHEEL_RADIUS, WHEEL_WIDTH = 0.35, 0.15, 0.15, 0.08  # m
SONAR_HEIGHT = 0.35  # m
UPRIGHT = "1.5707963 0 0"  # roll, pitch, yaw of a wheel's cylinder

Frame = tuple[str, tuple[float, float, float], float]  # name, position (m), yaw (rad)


def frames(vehicle: Vehicle) -> Iterator[Frame]:
    """Yield the frames in ``base_link``: wheels, then sonars."""
    for end, x in (("front", vehicle.wheelbase / 2), ("rear", -vehicle.wheelbase / 2)):
        for side, y in (("left", vehicle.track / 2), ("right", -vehicle.track / 2)):
            yield f"wheel_{end}_{side}", (x, y, WHEEL_RADIUS), 0.0
    for mount in sonar_mounts(vehicle):
        yield sonar_frame(mount), (mount.x, mount.y, SONAR_HEIGHT), mount.yaw


def describe(vehicle: Vehicle, prefix: str) -> str:
    """Return the URDF; ``prefix`` is that of the frames."""
    body = f'<box size="{vehicle.length} {vehicle.width} {BODY_HEIGHT}"/>'
    wheel = f'<cylinder radius="{WHEEL_RADIUS}" length="{WHEEL_WIDTH}"/>'
    height = CLEARANCE + BODY_HEIGHT / 2
    parts = [_link(f"{prefix}base_link", f"0 0 {height}", "0 0 0", body)]
    for name, (x, y, z), yaw in frames(vehicle):
        if name.startswith("wheel"):
            parts.append(_link(prefix + name, "0 0 0", UPRIGHT, wheel))
        else:
            parts.append(f"<link name={quoteattr(prefix + name)}/>")
        parts.append(_joint(prefix, name, f"{x} {y} {z}", yaw))
    inner = "\n".join(f"  {part}" for part in parts)
    return f'<?xml version="1.0"?>\n<robot name="t2">\n{inner}\n</robot>\n'


def _link(name: str, xyz: str, rpy: str, geometry: str) -> str:
    visual = f'<visual><origin xyz="{xyz}" rpy="{rpy}"/><geometry>{geometry}</geometry></visual>'
    return f"<link name={quoteattr(name)}>{visual}</link>"


def _joint(prefix: str, name: str, xyz: str, yaw: float) -> str:
    ends = f'<parent link="{prefix}base_link"/><child link="{prefix}{name}"/>'
    origin = f'<origin xyz="{xyz}" rpy="0 0 {yaw}"/>'
    return f'<joint name="{prefix}{name}_joint" type="fixed">{ends}{origin}</joint>'
