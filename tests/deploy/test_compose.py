"""``compose.yaml`` as parsed by Compose; no engine needed."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from common import realtime
from verification.containers.engine import compose

ROOT = Path(__file__).parents[2]
ENV = "deploy/compose/robot.env"
OWN_ROUTER, TLS = "deploy/compose/own-router.yaml", "deploy/compose/tls.yaml"
REALTIME = "deploy/compose/realtime.yaml"
OPTIONAL = {"sim", "laptop", "ros2"}  # services, each with a profile of its name
PROFILES = [word for name in sorted(OPTIONAL) for word in ("--profile", name)]
OF_T2 = {"router", "router-settings", "bridge", "safety", "odom", "recorder", "dashboard"}


def config(*over: str, **environ: str) -> dict[str, str]:
    """Return the effective definition of each service, with ``robot.env``."""
    if not shutil.which("docker") or not (command := compose()):
        pytest.skip("Compose is not installed")
    files = [word for file in ("compose.yaml", *over) for word in ("-f", file)]
    whole = subprocess.run(
        [*command, "--env-file", ENV, *files, *PROFILES, "config"],
        cwd=ROOT, env={"PATH": os.environ["PATH"]} | environ,
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    services = re.split(r"^services:\n", whole, flags=re.MULTILINE)[1]
    services = re.split(r"^\w", services, flags=re.MULTILINE)[0]
    _, *parts = re.split(r"^  ([\w-]+):\n", services, flags=re.MULTILINE)
    return dict(zip(parts[::2], parts[1::2], strict=True))


@pytest.mark.parametrize("over", [(TLS,), (OWN_ROUTER, TLS)])
def test_every_container_has_the_robot_id(over: tuple[str, ...]) -> None:
    services = config(*over, T2_ROBOT="002")
    assert services.keys() == OF_T2 | OPTIONAL
    for name, text in services.items():
        assert re.search(r"^ +T2__ROBOT__ID: .?002", text, re.MULTILINE), name


def test_the_default_robot_id() -> None:
    assert all(re.search(r"T2__ROBOT__ID: .?001", text) for text in config(TLS).values())


def test_a_laptop_connects_to_the_vehicles_wifi() -> None:
    assert "T2__BUS__CONNECT: tls/192.168.201.1:7447\n" in config(TLS)["laptop"]


def test_only_the_control_chain_has_realtime_priority() -> None:
    granted = re.compile(rf"^ +rtprio: {realtime.GUARD}$", re.MULTILINE)
    ahead = {name for name, text in config(TLS, REALTIME).items() if granted.search(text)}
    assert ahead == {"router", "bridge", "safety"}
    assert not any("rtprio" in text for text in config(TLS).values())


def test_no_file_uses_the_boards_network() -> None:
    """No container uses the board's network: deploy/nftables/t2.nft drops its traffic."""
    for file in (ROOT / "compose.yaml", *(ROOT / "deploy" / "compose").iterdir()):
        assert "10.7.5." not in file.read_text(encoding="utf-8"), file


@pytest.mark.parametrize("over", [(TLS,), (OWN_ROUTER, TLS, REALTIME)])
def test_only_bridge_and_safety_have_the_drive_link(over: tuple[str, ...]) -> None:
    services = config(*over)
    mounted = {name for name, text in services.items() if "target: /run/t2-drive" in text}
    short = {name for name, text in services.items() if "drive:/run/t2-drive" in text}
    assert mounted | short == {"bridge", "safety"}
    for name in ("bridge", "safety"):
        wanted = "T2__BUS__DRIVE: unixsock-stream//run/t2-drive/drive.sock"
        assert wanted in services[name], name
