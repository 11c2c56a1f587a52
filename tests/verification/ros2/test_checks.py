"""The plain peer's bytes, the rows of the table, and one real check."""

import contextlib
from pathlib import Path

import pytest

from services.ros2 import cdr, names
from verification.ros2 import __main__ as program
from verification.ros2 import plain_peer
from verification.ros2.peers import held_reset
from verification.ros2.plain_peer import Twist, text
from verification.ros2.robot import Robot

NO_NODE = Path("not-built")


def test_the_plain_peer_agrees_with_the_gateway() -> None:
    stamped = "geometry_msgs/msg/TwistStamped"
    assert names.data_key(0, "/a", stamped) == f"0/a/{plain_peer.TWIST}"
    assert names.data_key(0, "/a", "std_msgs/msg/String") == f"0/a/{plain_peer.TEXT}"
    assert names.data_key(0, "/a", "std_srvs/srv/Trigger") == f"0/a/{plain_peer.TRIGGER}"
    header, twist = cdr.decode(stamped, Twist(linear=0.4, angular=-0.2).encode())
    assert (header, twist) == (((0, 0), "base_link"), ((0.4, 0.0, 0.0), (0.0, 0.0, -0.2)))
    assert text(cdr.encode("std_msgs/msg/String", ("<robot/>",)), 4) == "<robot/>"


def test_a_failed_check_is_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(_: Robot) -> str:
        raise AssertionError("moved 0.50 m")

    monkeypatch.setattr(program, "robot_with_gateway", lambda *_: contextlib.nullcontext())
    row = program.run("fails", fails, NO_NODE)
    assert row == ("fails", "AssertionError: moved 0.50 m", "FAILED")


@pytest.mark.timed
@pytest.mark.campaign
def test_one_check() -> None:
    _, observed, mark = program.run("held_reset", held_reset, NO_NODE)
    assert mark == "ok", observed
