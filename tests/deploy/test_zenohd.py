"""A real ``zenohd`` as the stack's router, and a second one with the REST plugin.

Not installed, its tests are skipped: see deploy/zenohd/README.md.
"""

import base64
import json
import os
import shutil
import subprocess
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from common.bus.bus import Bus
from common.loop import Loop
from t2 import codec, keys
from t2.messages import Odometry
from tests.cli.processes import ran, sets
from tests.drive_source import ConstantSource, drive_until_moving, moves_since
from verification.harness.bus import at, bus_on, joined, running
from verification.harness.certificates import Site
from verification.harness.ports import free_port
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import wait_until

ZENOHD = os.environ.get("ZENOHD") or shutil.which("zenohd") or ""
pytestmark = [
    pytest.mark.timed,
    pytest.mark.skipif(not ZENOHD, reason="zenohd not found, neither by ZENOHD nor on PATH"),
]
SETTINGS = Path(__file__).parents[2] / "deploy" / "zenohd" / "rest.json5"
INFO = keys.info_key("001", "safety", "last")
FILES = {
    "ca": "root_ca_certificate",
    "certificate": "connect_certificate",
    "private_key": "connect_private_key",
}


def command(folder: Path, given: Sequence[str]) -> list[str]:
    """Return the command of zenohd with the configuration from ``t2 router --print``."""
    printed = ran("router", "--print", *sets(*given))
    assert printed.returncode == 0, printed.stderr
    (folder / "zenohd.json5").write_text(printed.stdout, encoding="utf-8")
    return [ZENOHD, "-c", str(folder / "zenohd.json5")]


def http(port: int, path: str, method: str = "GET") -> bytes:
    """GET or PUT a key over REST."""
    url = f"http://127.0.0.1:{port}/{path}"
    request = urllib.request.Request(url, headers={"Accept": "application/json"}, method=method)
    with urllib.request.urlopen(request, timeout=15) as answer:
        return bytes(answer.read())


def rows(port: int, path: str) -> list[dict[str, Any]]:
    """GET a key, and return all replies; none while REST does not listen."""
    with suppress(OSError):
        found: list[dict[str, Any]] = json.loads(http(port, path))
        return found
    return []


@contextmanager
def rest(folder: Path, endpoint: str, tls: dict[str, object] | None = None) -> Iterator[int]:
    """Run zenohd with REST as a client of a router; yield its port, or skip without plugins."""
    port = free_port()
    changes: dict[str, object] = {
        "plugins/rest/http_port": f"127.0.0.1:{port}", "connect/endpoints": [endpoint],
    }  # fmt: skip
    if tls:
        changes["transport/link/tls"] = tls
    words = [f"--cfg={path}:{json.dumps(value)}" for path, value in changes.items()]
    log = folder / "rest.log"
    with log.open("wb") as output:
        process = subprocess.Popen([ZENOHD, "-c", SETTINGS, *words], stdout=output, stderr=output)
    try:
        wait_until(lambda: process.poll() is not None or rows(port, INFO), f"an answer; {log}")
        if process.poll() is not None and "library not found" in log.read_text().lower():
            pytest.skip("this zenohd has no plugins for REST and storages")
        assert process.poll() is None, log.read_text()
        yield port
    finally:
        process.kill()
        process.wait()


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningStack]:
    """Run the stack on zenohd."""
    folder: Path = tmp_path_factory.mktemp("stack")
    with running_stack(folder, route=partial(command, folder)) as it:
        yield it


def test_it_drives_stops_and_survives_the_routers_death(stack: RunningStack) -> None:
    def reset() -> bool:
        done = ran("call", "safety/reset", *sets(f"bus.connect={stack.endpoint}"))
        return done.returncode == 0

    with running(Loop()) as loop:
        source = ConstantSource(loop)
        with bus_on(stack.endpoint, loop, source.declare):
            drive_until_moving(stack, source)
            stopped = ran("estop", *sets(f"bus.connect={stack.endpoint}"))
            assert stopped.returncode == 0, stopped.stderr
            wait_until(lambda: stack.last() == "brake", "BRAKE at the board")
            assert not moves_since(stack, len(stack.trace().commands))
            source.linear = 0.0
            wait_until(reset, "a reset")
            drive_until_moving(stack, source)

            stack.kill("router")
            wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")
            count = len(stack.trace().commands)
            stack.start("router")
            assert not moves_since(stack, count)
            source.linear = 0.0
            wait_until(reset, "a reset")
            drive_until_moving(stack, source)


def test_the_newest_message_is_read_over_http(stack: RunningStack, tmp_path: Path) -> None:
    key = keys.ODOMETRY.on("001")
    with rest(tmp_path, stack.endpoint) as port:
        (row,) = wait_until(lambda: rows(port, key), "odometry in the storage")
        assert row["encoding"] == codec.encoding(Odometry)
        first = codec.decode(base64.b64decode(row["value"]), Odometry).seq
        raw = partial(http, port, f"{key}?_raw")
        wait_until(lambda: codec.decode(raw(), Odometry).seq > first, "newer odometry")


@contextmanager
def secured(folder: Path) -> Iterator[tuple[str, list[str], Site]]:
    """Run zenohd with a site's access rules; yield its TLS, and the puts on board."""
    site = Site(folder / "keys")
    site.member("viewer", "rest")
    site.member("driver", "rest", "--robot", "001")
    own = site.member("robot", "001", "--address", "127.0.0.1")
    outside, onboard = f"tls/127.0.0.1:{free_port()}", f"unixsock-stream/{folder}/bus.sock"
    given = [f"bus.{name}={getattr(own, name)}" for name in (*FILES, "members")]
    started = command(folder, [*given, f"bus.listen={outside},{onboard}"])
    puts: list[str] = []

    def declare(bus: Bus) -> None:
        for key in (keys.estop_key("001"), keys.MOTION.on("001")):
            bus.on_any(key, lambda _, key=key: puts.append(key))  # type: ignore[misc]
        bus.answer(INFO, lambda: b"{}", "application/json")

    with (folder / "zenohd.log").open("wb") as log:
        process = subprocess.Popen(started, stdout=log, stderr=log)
    try:
        wait_until((folder / "bus.sock").exists, f"the router; {log.name}")
        with running(Loop()) as loop, joined(at(onboard), "001", loop, declare):
            yield outside, puts, site
    finally:
        process.kill()
        process.wait()


def test_permissions_over_http_are_those_of_the_certificate(tmp_path: Path) -> None:
    with secured(tmp_path) as (outside, puts, site):
        for role in ("viewer", "driver"):
            own = site.settings(role, "rest")
            tls = {theirs: getattr(own, name) for name, theirs in FILES.items()}
            with rest(tmp_path, outside, {**tls, "enable_mtls": True}) as port:
                http(port, keys.MOTION.on("001"), "PUT")
                http(port, keys.estop_key("001"), "PUT")
                assert rows(port, INFO)  # processed after them
                if role == "driver":
                    wait_until(lambda: puts, "a driver's emergency stop")
            assert puts == [keys.estop_key("001")] * (role == "driver")
