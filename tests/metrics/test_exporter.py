"""The exporter on a real bus, scraped over HTTP."""

import contextlib
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from common.cli_args import EXIT_LINK
from services.metrics import exporter
from services.metrics.exporter import Exporter
from t2 import codec, keys
from t2 import messages as m
from t2.keys import Topic
from tests.cli.inspect.tool import pretend
from tests.common.bus_fixture import BusFixture, until_received
from tests.factories import health, odometry
from tests.metrics.robots import event, link, names, safety
from tests.metrics.scraping import running, scraped, value
from verification.harness.bus import router_process
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until


def test_scrape_of_a_running_robot(buses: BusFixture, tmp_path: Path) -> None:
    robot = {"robot": buses.robot}
    with running(buses.endpoint, tmp_path, f"robot.id={buses.robot}") as port:
        assert value(port, "t2_robot_up", **robot) == 0
        pretend(buses, "bridge", {keys.HEALTH: health, keys.LINK: link}, service="bridge")
        told: dict[Topic[Any], Callable[[], m.Message]] = {
            keys.SAFETY: lambda: safety("estop"),
            keys.EVENTS: lambda: event("contact"),
        }
        pretend(buses, "safety", told, service="safety")
        pretend(buses, "odom", {keys.ODOMETRY: odometry})
        wanted = {"t2_link_armed", "t2_safety_latched", "t2_odometry_slip", "t2_service_rss_bytes"}
        wanted |= {"t2_events_total"}
        wait_until(lambda: wanted <= names(scraped(port)), "every stream")
        assert value(port, "t2_robot_up", **robot) == 1
        assert value(port, "t2_service_up", service="bridge", **robot) == 1
        assert value(port, "t2_safety_latched", name="estop", **robot) == 1
        assert value(port, "t2_link_rejected", name="crc", **robot) == 3


def test_all_robots_of_a_site_are_exported(buses: BusFixture, tmp_path: Path) -> None:
    root = "t2/v1"
    site, stranger = f"{buses.robot}s", buses.session()

    def put() -> None:
        for robot in (f"{site}-1", f"{site}-2", f"other-{buses.robot}"):
            stranger.put(f"{root}/{robot}/tel/bridge/link", codec.encode(link()))
        only_named = f"{root}/{site}-3/tel/dashboard/health"
        stranger.put(only_named, codec.encode(health("dashboard")))

    with running(buses.endpoint, tmp_path, f"metrics.robots={site}-$*") as port:
        until_received(
            put,
            lambda: {
                dict(labels).get("robot")
                for name, labels in scraped(port)
                if name == "t2_link_armed"
            } == {f"{site}-1", f"{site}-2"},
            "both robots of the site, and no other",
        )  # fmt: skip
        assert value(port, "t2_robot_up", robot="001") is None
        assert value(port, "t2_robot_up", robot=f"{site}-3") is None  # only a laptop has its id


def test_router_loss_is_exported(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with contextlib.ExitStack() as stack:
        with router_process(endpoint):
            port = stack.enter_context(running(endpoint, tmp_path))
        wait_until(lambda: value(port, "t2_bus_connected") == 0, "the router's end")
        with router_process(endpoint):
            wait_until(lambda: value(port, "t2_bus_connected") == 1, "the next router")
            stack.close()


def test_a_taken_port_ends_it_with_its_name(buses: BusFixture) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        words = [f"bus.connect={buses.endpoint}", f"metrics.port={port}"]
        done = subprocess.run(
            [sys.executable, "-m", "services.metrics", *(w for t in words for w in ("--set", t))],
            capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
    assert done.returncode == EXIT_LINK
    assert f"metrics cannot listen on 127.0.0.1:{port}" in done.stderr


def test_a_hanging_loop_raises_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exporter, "PATIENCE_S", 0.05)
    hanging = Exporter.__new__(Exporter)
    hanging.__dict__["_node"] = SimpleNamespace(loop=SimpleNamespace(post=lambda _: None))
    with pytest.raises(TimeoutError):
        hanging.collect()
