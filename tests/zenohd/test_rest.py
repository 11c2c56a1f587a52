"""The bus over HTTP: reading, and permissions."""

import base64
import contextlib
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import msgspec
import pytest

from cli.run.router import RouterConfig, access_of
from common import codec, keys
from common.bus.bus import Bus
from common.loop import Loop
from common.messages import Odometry
from tests.common.bus_fixture import rising
from tests.zenohd.router import Rest, command, found, rest
from verification.harness.bus import at, joined, running
from verification.harness.certificates import Site
from verification.harness.ports import free_port
from verification.harness.stack import RunningStack
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed

ODOMETRY = keys.ODOMETRY.on("001")


@pytest.fixture(scope="module")
def http(stack: RunningStack, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rest]:
    log = tmp_path_factory.mktemp("rest") / "rest.log"
    with rest(found(), log, stack.endpoint) as it:
        yield it


def odometry(http: Rest) -> Odometry:
    """Return the odometry in the storage."""
    (row,) = wait_until(lambda: http.rows(ODOMETRY), "odometry in the storage")
    assert row["key"] == ODOMETRY
    assert row["encoding"] == codec.encoding(Odometry)
    return codec.decode(base64.b64decode(row["value"]), Odometry)


def test_the_newest_odometry_is_read_over_http(http: Rest) -> None:
    first = odometry(http)
    wait_until(lambda: odometry(http).seq > first.seq, "newer odometry")
    raw = codec.decode(http.get(f"{ODOMETRY}?_raw"), Odometry)
    assert raw.boot == first.boot


def test_the_last_message_of_a_service_is_json_without_a_storage(http: Rest) -> None:
    (row,) = wait_until(lambda: http.rows(keys.info_key("001", "odom", "last")), "an answer")
    assert row["value"][ODOMETRY]["frame_id"] == "odom"


def test_a_wildcard_reads_all_streams(http: Rest) -> None:
    wanted = {f"t2/v1/001/{path}" for path in ("tel/bridge/velocity", "tel/safety/state")}
    wait_until(
        lambda: wanted <= {row["key"] for row in http.rows("t2/v1/001/tel/**")}, "all streams"
    )


def test_a_stream_is_followed(http: Rest) -> None:
    rows = [msgspec.json.decode(data) for data in islice(http.follow(ODOMETRY), 3)]
    came = [codec.decode(base64.b64decode(row["value"]), Odometry).seq for row in rows]
    assert rising(came)


@contextlib.contextmanager
def secured(site: Site, folder: Path, *words: str) -> Iterator[tuple[str, str]]:
    """Run zenohd with this site's access control; yield its TLS and its local endpoint.

    ``words`` are additional options of zenohd.
    """
    outside, onboard = f"tls/127.0.0.1:{free_port()}", f"unixsock-stream/{folder}/bus.sock"
    own = site.settings("robot", "001")
    assert access_of(RouterConfig(bus=own)) is not None
    given = [f"bus.{name}={getattr(own, name)}" for name in FILES]
    given.append(f"bus.listen={outside},{onboard}")
    with (folder / "zenohd.log").open("wb") as log:
        started = [*command(found(), folder, given), *words]
        process = subprocess.Popen(started, stdout=log, stderr=log)
    try:
        wait_until((folder / "bus.sock").exists, f"the router; {log.name}")
        yield outside, onboard
    finally:
        process.kill()
        process.wait()


FILES = ("ca", "certificate", "private_key", "members")


def files(site: Site, role: str, name: str) -> dict[str, object]:
    """Return a member's files as Zenoh settings."""
    own = site.settings(role, name)
    return {
        "root_ca_certificate": own.ca,
        "connect_certificate": own.certificate,
        "connect_private_key": own.private_key,
        "enable_mtls": True,
    }


@dataclass
class OnBoard:
    """Messages that arrive on the robot, and one answer."""

    estops: list[int] = field(default_factory=list)
    motions: list[int] = field(default_factory=list)

    def declare(self, bus: Bus) -> None:
        bus.on_any(keys.estop_key("001"), self.estops.append)
        bus.on_any(keys.MOTION.on("001"), self.motions.append)
        bus.answer(INFO, lambda: b'{"value": 1}', "application/json")


INFO = keys.info_key("001", "safety", "last")


@pytest.fixture
def site(tmp_path: Path) -> Site:
    found()
    made = Site(tmp_path / "keys")
    made.member("robot", "001", "--address", "127.0.0.1")
    return made


def test_permissions_over_http_are_those_of_the_certificate(site: Site, tmp_path: Path) -> None:
    site.member("viewer", "rest")
    site.member("driver", "rest", "--robot", "001")
    robot = OnBoard()
    with (
        secured(site, tmp_path) as (outside, onboard),
        running(Loop()) as loop,
        joined(at(onboard), "001", loop, robot.declare),
    ):
        with rest(found(), tmp_path / "viewer.log", outside, files(site, "viewer", "rest")) as http:
            wait_until(lambda: http.rows(INFO), "an answer")
            http.put(keys.estop_key("001"), b"")
            assert http.rows(INFO)[0]["value"] == {"value": 1}  # processed after it
            assert robot.estops == []
        with rest(found(), tmp_path / "driver.log", outside, files(site, "driver", "rest")) as http:
            wait_until(lambda: http.rows(INFO), "an answer")
            http.put(keys.MOTION.on("001"), b"")
            http.put(keys.estop_key("001"), b"")
            wait_until(lambda: robot.estops, "a driver's emergency stop")
            assert robot.motions == []


def test_a_plugin_of_the_router_bypasses_its_access_control(site: Site, tmp_path: Path) -> None:
    """The reason for a separate zenohd for REST; when this fails, it is not needed any more."""
    http, robot = Rest(free_port()), OnBoard()
    plugin = f'{{__required__: true, http_port: "127.0.0.1:{http.port}"}}'
    with (
        secured(site, tmp_path, f"--cfg=plugins/rest:{plugin}") as (_, onboard),
        running(Loop()) as loop,
        joined(at(onboard), "001", loop, robot.declare),
    ):
        wait_until(lambda: http.answers() and http.rows(INFO), "an answer")
        http.put(keys.MOTION.on("001"), b"")
        wait_until(lambda: robot.motions, "a motion, which only safety may publish")
