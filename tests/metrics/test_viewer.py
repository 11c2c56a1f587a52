"""The exporter with a viewer's certificate."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from common import keys
from common.bus.bus import Bus
from common.bus.publisher import Publisher
from common.keys import Topic
from common.loop import Loop
from common.messages import Message
from tests.metrics.robots import health, link, odometry, safety
from tests.metrics.scraping import running as exporting
from tests.metrics.scraping import scraped, value
from tests.metrics.values import names
from verification.harness.bus import at, joined, running
from verification.harness.certificates import Site
from verification.harness.waiting import wait_until

ROBOT = "001"


@pytest.fixture
def loop() -> Iterator[Loop]:
    with running(Loop()) as it:
        yield it


def test_a_viewer_certificate_is_sufficient(loop: Loop, tmp_path: Path) -> None:
    site = Site(tmp_path / "keys")
    own = site.member("robot", ROBOT, "--address", "127.0.0.1")
    viewer = site.member("viewer", "prometheus")
    printed: dict[Topic[Any], Message] = {
        keys.SAFETY: safety(),
        keys.LINK: link(),
        keys.ODOMETRY: odometry(),
        keys.HEALTH: health(),
    }
    puts: list[tuple[Publisher[Any], Message]] = []

    def declare(bus: Bus) -> None:
        bus.live(keys.live_key(ROBOT, "bridge", "1"))
        puts.extend((bus.publisher(topic, service="bridge"), one) for topic, one in printed.items())

    def put(_: int) -> None:
        for publisher, message in puts:
            publisher.put(message)

    with site.router(own) as (secured, onboard), joined(at(onboard), ROBOT, loop, declare):
        loop.post(lambda: loop.every(0.1, put))
        files = {name: getattr(viewer, name) for name in ("ca", "certificate", "private_key")}
        sets = [f"bus.{name}={path}" for name, path in files.items()]
        with exporting(secured, tmp_path, *sets, "metrics.robots=*") as port:
            wanted = {"t2_safety_source", "t2_link_armed", "t2_odometry_slip"}
            wait_until(lambda: wanted <= names(scraped(port)), "the streams")
            wait_until(
                lambda: value(port, "t2_service_up", robot=ROBOT, service="bridge") == 1,
                "the token and the health",
            )
