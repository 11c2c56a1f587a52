"""docs/integrate.md with certificates, and its own test file, as they stand there."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import t2
from cli.demo import host_stalls
from tests.docs.integrator import (
    ENVIRONMENT,
    LEASES,
    PAGE,
    TRIES,
    Integrator,
    running_integrator,
    save_files,
)
from verification.harness.certificates import ADDRESS, Site
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

pytestmark = [pytest.mark.timed, pytest.mark.campaign, pytest.mark.timeout(300)]

ROBOT, ISSUED = "tls/192.168.201.1:7447", "driver.planner/"  # in planner.json5 of the page
FILES = ("ca=ca.pem", "certificate=certificate.pem", "private_key=private.key",
         "members=members.json")  # fmt: skip


@pytest.fixture(scope="module")
def it(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Integrator]:
    """Run a stack whose router admits the members that the page issues."""
    folder = tmp_path_factory.mktemp("secured")
    site, remote = Site(folder / "keys"), f"tls/{ADDRESS}:{free_port()}"
    site.keys("issue", "robot", "001", "--address", ADDRESS)
    for words in re.findall(r"^t2 keys (issue .*)$", PAGE.read_text("utf-8"), re.MULTILINE):
        site.keys(*words.split())
    sets = [f"bus.{one.replace('=', f'={site.folder}/robot.001/')}" for one in FILES]
    for file in site.folder.glob("*/bus.toml"):  # this router has another port
        text = re.sub(r'"tls/[^"]+"', f'"{remote}"', file.read_text(encoding="utf-8"))
        file.write_text(text, encoding="utf-8")
    listen = f"unixsock-stream/{folder}/bus.sock,{remote}"
    with running_integrator(folder, sets=sets, listen=listen) as it:
        planner = folder / "planner.json5"
        text = planner.read_text(encoding="utf-8").replace(ROBOT, remote)
        planner.write_text(text.replace(ISSUED, f"keys/{ISSUED}"), encoding="utf-8")
        yield it


def connected(it: Integrator, member: str) -> t2.Robot:
    return t2.connect("001", config=it.folder / "keys" / member / "bus.toml")


def test_a_program_drives_with_its_certificate(it: Integrator) -> None:
    with it.limited("plain/limit.py"):
        it.check_drive("plain/drive.py", "planner.json5")


def test_the_package_reports_a_certificate_that_may_not_drive(it: Integrator) -> None:
    with (
        it.limited("plain/limit.py"),
        connected(it, "viewer.screen") as robot,
        pytest.raises(t2.NotAllowed, match="this certificate may not drive"),
        robot.drive("shuttle"),
    ):
        pass


def test_the_package_reports_a_certificate_that_may_not_limit(it: Integrator) -> None:
    with connected(it, "device.detector") as robot:
        wait_until(lambda: robot.safety.latest(5.0).limit_sources[0].silent, "no other program")
        robot.limit("detector", linear=0.1, seconds=60)
    with (
        connected(it, "driver.planner") as robot,
        pytest.raises(t2.NotAllowed, match="safety does not show the limit of 'detector'"),
    ):
        robot.limit("detector", linear=0.2, seconds=60)


def test_the_test_file_of_the_page(tmp_path: Path) -> None:
    """It drives the simulated vehicle, with settings for the stalls of this host."""
    save_files(tmp_path)
    stalls = host_stalls.settings(max(host_stalls.measured(), 0.3))
    sets = host_stalls.with_overrides_joined([*stalls, LEASES[0]])
    given = dict(one.split("=", 1) for one in sets)
    env = {f"T2__{name.upper().replace('.', '__')}": value for name, value in given.items()}
    env["PATH"] = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    words = ["-p", "no:cacheprovider", "-c", os.devnull, "--rootdir", str(tmp_path)]
    for _ in range(TRIES):
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *words, "test_shuttle.py"],
            cwd=tmp_path, env={**ENVIRONMENT, **env},
            capture_output=True, text=True, timeout=90, check=False,
        )  # fmt: skip
        if done.returncode == 0:
            break
    assert "2 passed" in done.stdout, done.stdout + done.stderr
