"""``t2 doctor`` beside a running gateway and nodes of ROS 2 that do not fit."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh

from cli.inspect import remedies
from common import child_process
from common.bus.session import client_config
from services.ros2 import names
from tests.cli.inspect.tool import Tool
from verification.harness.bus import at, set_options
from verification.harness.stack import running_stack
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed

ODOM = "nav_msgs/msg/Odometry"
TRIES_S = 60.0
Doctor = Callable[[], "list[tuple[str, str]]"]


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder: Path = tmp_path_factory.mktemp("ros")

    def gateway(config: Any) -> dict[str, list[str]]:
        options = set_options(f"bus.connect={config.bus.endpoints[0]}", "ros2.domain=7")
        return {"ros2": list(child_process.command("services.ros2", *options))}

    with running_stack(folder, beside=gateway) as it:
        yield it.endpoint


@pytest.fixture
def doctor(endpoint: str, capsys: pytest.CaptureFixture[str]) -> Doctor:
    tool = Tool(endpoint, "001", capsys)

    def diagnose() -> list[tuple[str, str]]:
        lines = tool("doctor", "--duration", "0.5").lines
        return [(each["level"], each["todo"]) for each in lines if each["where"] == "ros"]

    return diagnose


def test_the_gateway_alone_then_nodes_that_do_not_fit(endpoint: str, doctor: Doctor) -> None:
    wait_until(lambda: doctor() == [("note", remedies.ROS_NO_NODE)], "the gateway", TRIES_S)
    with zenoh.open(client_config(at(endpoint))) as session:
        zid = str(session.info.zid())
        nav, away = names.Node(7, zid, "/", "nav"), names.Node(3, zid, "/", "away")
        reads = nav.endpoint_token(4, "MS", "/odom", ODOM, names.QOS)
        tokens = [
            session.liveliness().declare_token(token)
            for token in (nav.token, away.token, reads.replace("RIHS01_", "RIHS01_0"))
        ]
        expected = {("ok", ""), ("wrong", remedies.ROS_DOMAIN), ("wrong", remedies.ROS_HASH)}
        wait_until(lambda: set(doctor()) == expected, "both problems", TRIES_S)
        for token in tokens:
            token.undeclare()
