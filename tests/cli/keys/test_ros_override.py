"""A computer with ROS 2 connects with the printed ``ZENOH_CONFIG_OVERRIDE``."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh

from cli.keys.machine_settings import ros_override
from common.bus.session import client_config
from services.ros2 import names
from verification.harness.bus import at
from verification.harness.certificates import Site
from verification.harness.waiting import wait_until

ODOM = names.data_key(0, "/odom", "nav_msgs/msg/Odometry")
CMD_VEL = names.data_key(0, "/cmd_vel", "geometry_msgs/msg/TwistStamped")
T2 = "t2/v1/001/@cmd/drive/ros2"


@pytest.fixture
def site(tmp_path: Path) -> Iterator[tuple[zenoh.Session, zenoh.Session]]:
    """Sessions on board and of a computer with ROS 2."""
    site = Site(tmp_path / "keys")
    site.member("ros", "laptop", "--robot", "001")
    robot = site.member("robot", "001", "--address", "127.0.0.1")
    with site.router(robot) as (secured, onboard):
        config = zenoh.Config()
        # As rmw_zenoh reads it: entries between semicolons, each a path and a JSON5 value.
        for entry in ros_override(str(site.folder / "ros.laptop"), secured).split(";"):
            config.insert_json5(*entry.split("=", 1))
        with zenoh.open(client_config(at(onboard))) as here, zenoh.open(config) as ros:
            yield here, ros


def test_it_reads_topics_and_writes_cmd_vel_alone(
    site: tuple[zenoh.Session, zenoh.Session],
) -> None:
    here, ros = site
    read: set[str] = set()
    written: set[str] = set()
    reader = ros.declare_subscriber("0/**", lambda sample: read.add(str(sample.key_expr)))
    writers = [here.declare_subscriber(key, lambda sample: written.add(str(sample.key_expr)))
               for key in ("**", "**/@cmd/**")]  # fmt: skip

    def both() -> bool:
        here.put(ODOM, b"")
        ros.put(T2, b"")
        ros.put(ODOM, b"")
        ros.put(CMD_VEL, b"")
        return ODOM in read and CMD_VEL in written

    wait_until(both, "a topic and a command")
    assert T2 not in written
    for each in (reader, *writers):
        each.undeclare()
