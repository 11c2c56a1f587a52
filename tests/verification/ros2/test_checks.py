"""The plain peer's bytes, and one real check."""

import sys
from functools import partial
from pathlib import Path

import pytest

from services.ros2 import cdr, names
from verification.ros2 import __main__ as program
from verification.ros2 import plain_peer
from verification.ros2.plain_peer import Twist, text


def test_the_plain_peer_agrees_with_the_gateway() -> None:
    stamped = "geometry_msgs/msg/TwistStamped"
    assert names.data_key(0, "/a", stamped) == f"0/a/{plain_peer.TWIST}"
    assert names.data_key(0, "/a", "std_msgs/msg/String") == f"0/a/{plain_peer.TEXT}"
    assert names.data_key(0, "/a", "std_srvs/srv/Trigger") == f"0/a/{plain_peer.TRIGGER}"
    assert names.data_key(0, "/a", "rcl_interfaces/srv/ListParameters") == f"0/a/{plain_peer.LIST}"
    header, twist = cdr.decode(stamped, Twist(linear=0.4, angular=-0.2).encode())
    assert (header, twist) == (((0, 0), "base_link"), ((0.4, 0.0, 0.0), (0.0, 0.0, -0.2)))
    assert text(cdr.encode("std_msgs/msg/String", ("<robot/>",)), 4) == "<robot/>"


@pytest.mark.timed
@pytest.mark.campaign
def test_the_check_of_an_older_zenoh_with_ours() -> None:
    python = Path(sys.executable)
    _, observed, mark = program.run("ours", partial(program.exercised, python=python), python)
    assert mark == "ok", observed
