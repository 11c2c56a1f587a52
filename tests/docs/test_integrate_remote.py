"""docs/integrate.md with certificates, and its own test file, as they stand there."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import t2
from cli.demo import host_stalls
from tests.cli.stack import ports
from tests.docs.integrator import LEASES, PAGE, TRIES, environment, lines_until, save_files
from tests.docs.secured import Secured, secured_integrator
from verification.harness.ports import free_port

UNNAMED = "safety.sources or your certificate does not name it"  # the page's program reports it

pytestmark = [pytest.mark.timed, pytest.mark.campaign, pytest.mark.timeout(300)]


@pytest.fixture(scope="module")
def secured(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Secured]:
    with secured_integrator(tmp_path_factory.mktemp("secured")) as it:
        yield it


def test_each_role_may_do_what_the_page_states(secured: Secured) -> None:
    it = secured.integrator
    driver, device, viewer = (
        secured.configuration(member)
        for member in ("driver.planner", "device.detector", "viewer.screen")
    )
    with it.running("plain/read.py", router=viewer) as process:
        lines_until(process, lambda line: "nearest" in line)
    with it.limited("plain/limit.py", router=device):
        it.check_success("plain/drive.py", router=driver)
        for other in (device, viewer):
            it.check_failure(f"patrol: {UNNAMED}\n", "plain/drive.py", router=other)


def test_the_package_takes_the_folder_of_a_certificate(secured: Secured) -> None:
    toml = secured.bus_toml("driver.planner")
    with t2.connect("001", config=toml) as robot:
        assert robot.odometry.latest(timeout=5.0).frame_id == "odom"


def test_the_package_reports_a_certificate_that_may_not_drive(secured: Secured) -> None:
    toml = secured.bus_toml("viewer.screen")
    with (
        secured.integrator.limited("plain/limit.py"),
        t2.connect("001", config=toml) as robot,
        pytest.raises(t2.NotAllowed, match="this certificate may not drive"),
        robot.drive("patrol"),
    ):
        pass


def test_the_package_reports_a_certificate_that_may_not_limit(secured: Secured) -> None:
    for member in ("viewer.screen", "driver.planner"):
        with (
            t2.connect("001", config=secured.bus_toml(member)) as robot,
            pytest.raises(t2.NotAllowed, match="safety does not show the limit of 'detector'"),
        ):
            robot.limit("detector", linear=0.1, seconds=60)
    with t2.connect("001", config=secured.bus_toml("device.detector")) as robot:
        robot.limit("detector", linear=0.1, seconds=60)
        assert secured.integrator.limit().linear == 0.1


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
