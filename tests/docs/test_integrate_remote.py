"""docs/integrate.md with certificates, and its own test file, as they stand there."""

import os
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import t2
from cli.demo import host_stalls
from common.config import Sources, load
from common.settings import Shared
from tests.cli.stack import ports
from tests.docs.integrator import (
    LEASES,
    PAGE,
    TRIES,
    Integrator,
    environment,
    lines_until,
    running_integrator,
    save_files,
)
from verification.harness.certificates import ADDRESS, Site
from verification.harness.ports import free_port

pytestmark = [pytest.mark.timed, pytest.mark.campaign, pytest.mark.timeout(300)]

ROBOT, DRIVER = "tls/192.168.201.1:7447", "driver.planner"  # in planner.json5 of the page
FILES = {
    "ca": "ca.pem",
    "certificate": "certificate.pem",
    "private_key": "private.key",
    "members": "members.json",
}


@pytest.fixture(scope="module")
def it(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Integrator]:
    """Run a stack whose router admits the members that the page issues; write their settings."""
    folder = tmp_path_factory.mktemp("secured")
    site = Site(folder / "keys")
    site.keys("issue", "robot", "001", "--address", ADDRESS)
    for words in re.findall(r"^t2 keys (issue .*)$", PAGE.read_text("utf-8"), re.MULTILINE):
        site.keys(*words.split())
    remote = f"tls/{ADDRESS}:{free_port()}"
    sets = [f"bus.{name}={site.folder / 'robot.001' / file}" for name, file in FILES.items()]
    listen = f"unixsock-stream/{folder}/bus.sock,{remote}"
    with running_integrator(folder, sets=sets, listen=listen) as it:
        for member in ("driver.planner", "device.detector", "viewer.screen"):
            write_settings(folder, member, remote)
        yield it


def write_settings(folder: Path, member: str, endpoint: str) -> None:
    """Write a member's Zenoh configuration as on the page, and its bus.toml, for this router."""
    text = (folder / "planner.json5").read_text(encoding="utf-8")
    text = text.replace(ROBOT, endpoint).replace(DRIVER, f"keys/{member}")
    (folder / f"{member}.json5").write_text(text, encoding="utf-8")
    file = folder / "keys" / member / "bus.toml"
    bus = load(Shared, Sources(files=(file,), environ={})).config.bus
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace(bus.connect[0], endpoint), encoding="utf-8")


def test_each_role_may_do_what_the_page_states(it: Integrator) -> None:
    with it.running("plain/read.py", "viewer.screen.json5") as process:
        lines_until(process, lambda line: "nearest" in line)
    with it.limited("plain/limit.py", "device.detector.json5"):
        it.check_end(0, "", "plain/drive.py", "driver.planner.json5")
        unnamed = "patrol: safety.sources or your certificate does not name it\n"
        for other in ("device.detector.json5", "viewer.screen.json5"):
            it.check_end(1, unnamed, "plain/drive.py", other)


def test_the_package_reports_what_a_certificate_may_not_do(it: Integrator) -> None:
    def connected(member: str) -> t2.Robot:
        return t2.connect("001", config=it.folder / "keys" / member / "bus.toml")

    with connected("viewer.screen") as robot:
        assert robot.odometry.latest(timeout=5.0).frame_id == "odom"
        with (
            it.limited("plain/limit.py"),
            pytest.raises(t2.NotAllowed, match="this certificate may not drive"),
            robot.drive("patrol"),
        ):
            pass
    for member in ("viewer.screen", "driver.planner"):
        with (
            connected(member) as robot,
            pytest.raises(t2.NotAllowed, match="safety does not show the limit of 'detector'"),
        ):
            robot.limit("detector", linear=0.1, seconds=60)
    with connected("device.detector") as robot:
        robot.limit("detector", linear=0.1, seconds=60)
        assert it.limit().linear == 0.1


def test_the_test_file_of_the_page(tmp_path: Path) -> None:
    """It drives the simulated vehicle, with settings for the stalls of this host."""
    save_files(PAGE, tmp_path)
    stalls = host_stalls.settings(max(host_stalls.measured(), 0.3))
    relaxed = {"bridge.unsafe_overrides", *(one.partition("=")[0] for one in stalls)}
    own = [one for one in ports() if one.partition("=")[0] not in relaxed]
    control = f"sim.control_port={free_port(socket.SOCK_DGRAM)}"
    sets = host_stalls.with_accepted_joined([*own, *stalls, LEASES[0], control])
    given = dict(one.split("=", 1) for one in sets)
    env = {f"T2__{name.upper().replace('.', '__')}": value for name, value in given.items()}
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    words = ["-p", "no:cacheprovider", "-c", os.devnull, "--rootdir", str(tmp_path)]
    command = [sys.executable, "-m", "pytest", *words, "test_patrol.py"]
    env |= {**environment(), "PATH": path, "ROUTER": given["bus.listen"]}
    for _ in range(TRIES):
        done = subprocess.run(
            command, cwd=tmp_path, env=env, capture_output=True, text=True, timeout=90, check=False
        )
        if done.returncode == 0:
            break
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 passed" in done.stdout
