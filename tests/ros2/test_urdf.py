"""The robot's description: one tree of frames, the same poses as /tf_static."""

from xml.etree import ElementTree

import pytest

from common.settings import Vehicle
from services.ros2 import urdf

VEHICLE = Vehicle(length=1.2, width=0.8, wheelbase=0.6, track=0.5)


def numbers(text: str | None) -> list[float]:
    return [float(number) for number in (text or "").split()]


def test_wheels_are_at_the_corners_of_wheelbase_and_track() -> None:
    wheels = {name: where for name, where, _ in urdf.frames(VEHICLE) if "wheel" in name}
    assert wheels == {
        "wheel_front_left": (0.3, 0.25, 0.15),
        "wheel_front_right": (0.3, -0.25, 0.15),
        "wheel_rear_left": (-0.3, 0.25, 0.15),
        "wheel_rear_right": (-0.3, -0.25, 0.15),
    }


def test_the_description_has_the_frames_and_poses_of_tf_static() -> None:
    root = ElementTree.fromstring(urdf.describe(VEHICLE, "r1/"))
    assert root.get("name") == "t2"
    poses = {name: (where, yaw) for name, where, yaw in urdf.frames(VEHICLE)}
    links = [link.get("name") for link in root.findall("link")]
    assert sorted(links, key=str) == sorted(["r1/base_link", *(f"r1/{name}" for name in poses)])
    joints = root.findall("joint")
    assert len(joints) == len(poses)
    for joint in joints:
        child, parent, origin = (joint.find(tag) for tag in ("child", "parent", "origin"))
        assert child is not None
        assert parent is not None
        assert origin is not None
        assert joint.get("type") == "fixed"
        assert parent.get("link") == "r1/base_link"
        where, yaw = poses[str(child.get("link")).removeprefix("r1/")]
        assert numbers(origin.get("xyz")) == pytest.approx(where)
        assert numbers(origin.get("rpy")) == pytest.approx([0.0, 0.0, yaw])


def test_the_body_has_the_vehicles_size() -> None:
    root = ElementTree.fromstring(urdf.describe(VEHICLE, ""))
    box = root.find("link[@name='base_link']/visual/geometry/box")
    assert box is not None
    assert numbers(box.get("size")) == [1.2, 0.8, 0.35]
    assert len(root.findall("link/visual/geometry/cylinder")) == 4
