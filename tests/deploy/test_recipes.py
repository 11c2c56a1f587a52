"""``compose.yaml`` as parsed by Compose, the wheel, and the relay's image: what is deployed."""

import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from cli.settings import Everything
from common import realtime
from common.config import flatten
from tests.cli.processes import PATIENCE_S, running, sets
from tests.cli.stack import STACK, ports, starts
from verification.harness.waiting import wait_until
from verification.system.containers import compose

ROOT = Path(__file__).parents[2]
ZENOHD, TLS = "deploy/compose/zenohd.yaml", "deploy/compose/tls.yaml"
REALTIME = "deploy/compose/realtime.yaml"
CHAIN = {"router", "bridge", "safety"}
OF_T2 = CHAIN | {"odom", "localization", "patrol", "recorder", "dashboard"}
# Services with a profile.
OPTIONAL = {
    "sim": "sim", "laptop": "laptop", "ros2": "ros2", "camera": "camera",
    "router-settings": "zenohd",
}  # fmt: skip
HOST_NETWORK = {"bridge", "sim"}
NO_NETWORK = {"safety", "odom", "localization", "patrol", "recorder"}
ISOLATED = (  # each container
    "\n    read_only: true\n", "\n    init: true\n", "\n    cap_drop:\n +- ALL\n",
    "no-new-privileges:true", " cpus(et)?: ", " mem_limit: ", " memswap_limit: ", " pids_limit: ",
    " max-size: ", "\n    restart: ", "\n    stop_grace_period: ",
)  # fmt: skip
SHIPPED = {"common", "services", "sim", "cli", "config", "deploy"}


def config(*overlays: str, **environ: str) -> dict[str, str]:
    """Return the effective definition of each service, with ``robot.env``."""
    if not any(map(shutil.which, ("docker", "docker-compose"))):
        pytest.skip("Compose is not installed")
    files = [word for file in ("compose.yaml", *overlays) for word in ("-f", file)]
    profiles = [word for name in OPTIONAL.values() for word in ("--profile", name)]
    whole = subprocess.run(
        [*compose(), "--env-file", "deploy/compose/robot.env", *files, *profiles, "config"],
        cwd=ROOT, env={"PATH": os.environ["PATH"]} | environ,
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    services = re.split(r"^services:\n", whole, flags=re.MULTILINE)[1]
    services = re.split(r"^\w", services, flags=re.MULTILINE)[0]
    _, *parts = re.split(r"^  ([\w-]+):\n", services, flags=re.MULTILINE)
    return dict(zip(parts[::2], parts[1::2], strict=True))


@pytest.mark.parametrize("overlays", [(TLS, REALTIME), (ZENOHD, TLS, REALTIME)])
def test_compose_gives_each_container_its_rights_only(overlays: tuple[str, ...]) -> None:
    services = config(*overlays, T2_ROBOT="002")
    assert services.keys() == OF_T2 | OPTIONAL.keys()
    assert all(re.search(r"\n +T2__ROBOT__ID: .?002", text) for text in services.values())
    drive = {name for name, text in services.items() if re.search(r"[ :]/run/t2-drive\b", text)}
    assert drive == {"bridge", "safety"}
    granted = {name for name, text in services.items() if f"rtprio: {realtime.GUARD}\n" in text}
    assert granted == CHAIN
    assert {name for name, text in services.items() if "cpuset: " in text} == CHAIN
    assert not [name for name in CHAIN if " cpus: " in services[name]]
    checked = {name for name, text in services.items() if "healthcheck:" in text}
    assert checked == OF_T2 | {"ros2", "camera"}
    assert (ZENOHD in overlays) == ("target: zenohd" in services["router"])
    assert "T2__BUS__CONNECT: tls/192.168.201.1:7447\n" in services["laptop"]
    for name, text in services.items():
        assert not [rule for rule in ISOLATED if not re.search(rule, f"\n{text}")], name
    for network, names in {"host": HOST_NETWORK, "none": NO_NETWORK}.items():
        using = {name for name, text in services.items() if f"network_mode: {network}\n" in text}
        assert using - {"router-settings", "ros2"} == names
    # deploy/nftables/t2.nft drops the traffic of containers on the board's network.
    for file in ("compose.yaml", *overlays):
        assert "10.7.5." not in (ROOT / file).read_text(encoding="utf-8"), file


def test_the_recipes_set_existing_settings() -> None:
    known = {name for name, _ in flatten(Everything())}
    files = [ROOT / "compose.yaml", *(it for it in (ROOT / "deploy").rglob("*.*") if it.is_file())]
    for file in files:
        for name in re.findall(r"\bT2__(\w+)[:=]", file.read_text(encoding="utf-8")):
            assert name.lower().replace("__", ".") in known, f"{file}: {name}"


def test_the_wheel_contains_what_ships(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert {name.partition("/")[0] for name in names} == SHIPPED
    listed = ["git", "ls-files", *SHIPPED - {"deploy"}, "deploy/systemd"]
    tracked = subprocess.run(listed, cwd=ROOT, check=True, capture_output=True, text=True)
    assert set(tracked.stdout.split()) <= names
    assert not [name for name in names if "test" in name.lower()]
    assert not [name for name in names if re.match("deploy/(?!systemd/)", name)]


def test_foreign_packages_have_no_precedence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("common", "services", "sim", "config"):  # as in a ROS workspace
        package = tmp_path / "workspace" / name
        package.mkdir(parents=True)
        (package / "__init__.py").write_text(f"raise ImportError('the foreign {name}')\n")
    monkeypatch.chdir(tmp_path / "workspace")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "workspace"))
    log = tmp_path / "log"
    t2 = str(Path(sys.executable).with_name("t2"))
    settings = sets(*ports(), "log.format=json", f"recorder.folder={tmp_path}")
    with running([t2, "up", *settings], log) as up:
        wait_until(
            lambda: up.poll() is not None or all(starts(log, name) for name in STACK),
            "all six, or the end",
            PATIENCE_S,
        )
        assert up.poll() is None, log.read_text()
        up.terminate()
        assert up.wait(PATIENCE_S) == 0
    assert "the foreign" not in log.read_text()


def test_the_relays_recipe_installs_its_program_and_unit(tmp_path: Path) -> None:
    root, tools = tmp_path / "root", tmp_path / "tools"
    for folder in (root / "usr/bin", root / "etc/systemd/system", tools):
        folder.mkdir(parents=True)
    for tool in (root / "usr/bin/python3", tools / "systemctl"):
        tool.symlink_to("/bin/true")
    environ = {"PATH": f"{tools}:/usr/bin:/bin"}
    subprocess.run(["sh", ROOT / "deploy/relay/image.sh", root], check=True, env=environ)
    program = {path.name: path.read_bytes() for path in (ROOT / "services/relay").glob("*.py")}
    assert program == {path.name: path.read_bytes() for path in (root / "opt/t2/relay").iterdir()}
    unit = (root / "etc/systemd/system/t2-relay.service").read_text()
    assert {"Restart=always", "WatchdogSec=500ms"} <= set(unit.splitlines())
    if shutil.which("systemd-analyze"):
        command = ["systemd-analyze", "verify", "--man=no", f"{ROOT}/deploy/relay/t2-relay.service"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert "t2-relay" not in done.stderr
