"""The exporter as a process on a real bus, scraped over HTTP."""

import contextlib
import subprocess
import sys
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from prometheus_client.parser import text_string_to_metric_families

from common.cli_args import EXIT_LINK
from services.metrics import exporter
from services.metrics.exporter import Exporter
from t2 import codec, keys
from t2 import messages as m
from t2.keys import Topic
from tests.cli.inspect.tool import pretend
from tests.common.bus_fixture import BusFixture, until_received
from tests.common.conftest import buses
from tests.factories import health, odometry
from tests.metrics.robots import Values, event, flat, link, names, safety
from verification.harness.bus import router_process, set_options
from verification.harness.ports import free_port
from verification.harness.waiting import PATIENCE_S, wait_until

__all__ = ["buses"]


def scraped(port: int) -> Values:
    """Scrape with the parser of Prometheus' client."""
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=10) as answer:
        text = answer.read().decode()
    return flat(list(text_string_to_metric_families(text)))


def value(port: int, name: str, /, **labels: str) -> float | None:
    """Return a sample's value, None when there is no such sample."""
    return scraped(port).get((name, frozenset(labels.items())))


def command(endpoint: str, port: int, *sets: str) -> list[str]:
    given = set_options(f"bus.connect={endpoint}", f"metrics.port={port}", *sets)
    return [sys.executable, "-m", "cli", "metrics", *given]


@contextlib.contextmanager
def running(endpoint: str, folder: Path, *sets: str) -> Iterator[int]:
    """Run the exporter as a process while the context lasts; yield its port."""
    port = free_port()
    with (
        (folder / "metrics.log").open("wb") as log,
        subprocess.Popen(command(endpoint, port, *sets), stdout=log, stderr=log) as process,
    ):

        def answers() -> bool:
            assert process.poll() is None, (folder / "metrics.log").read_text()
            with contextlib.suppress(OSError):
                return value(port, "t2_bus_connected") == 1
            return False

        try:
            wait_until(answers, "the page", 2 * PATIENCE_S)
            yield port
            process.terminate()
            assert process.wait(PATIENCE_S) == 0
        finally:
            process.kill()


def test_a_running_robot_and_a_second_exporter_on_the_port(
    buses: BusFixture, tmp_path: Path
) -> None:
    robot = {"robot": buses.robot}
    with running(buses.endpoint, tmp_path, f"robot.id={buses.robot}") as port:
        assert value(port, "t2_robot_up", **robot) == 0
        assert value(port, "t2_service_up", service="bridge", **robot) == 0
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
        second = subprocess.run(
            command(buses.endpoint, port), capture_output=True, text=True, timeout=60, check=False
        )
        assert second.returncode == EXIT_LINK
        assert f"metrics cannot listen on 127.0.0.1:{port}" in second.stderr


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


def test_a_hanging_loop_raises_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exporter, "PATIENCE_S", 0.05)
    hanging = Exporter.__new__(Exporter)
    hanging.__dict__["_node"] = SimpleNamespace(loop=SimpleNamespace(post=lambda _: None))
    with pytest.raises(TimeoutError):
        hanging.collect()
