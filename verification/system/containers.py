"""The containers of compose.yaml: isolation and crashes; ``T2_BASE`` names a base image."""

import json
import os
import re
import secrets
import shutil
import signal
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import av

from verification.harness.ports import udp_ports
from verification.harness.waiting import wait_until
from verification.system import frame
from verification.system.frame import ROOT, Container, Vehicle, attempt, run

OVERLAYS = ("compose.yaml", "deploy/compose/tls.yaml")
CHAIN = ("router", "bridge", "safety")
# They have a health check.
HEALTHY = (*CHAIN, "odom", "localization", "patrol", "recorder", "dashboard", "camera")
SERVICES = (*HEALTHY, "sim")
USER, ROBOT_MB = 10001, 120.0
TOOLS = ("sh", "bash", "busybox", "apt", "dpkg", "pip", "perl")
HEALTHY_S = 180.0
STOPS_S, RESTARTS_S = 1.0, 15.0  # docs/faults.md measures what the processes need: 0.25 s


class Stack:
    """The containers of a Compose project, and their vehicle."""

    vehicle: Vehicle

    def __init__(self, folder: Path, base: str) -> None:
        self.name = f"t2-test{secrets.token_hex(3)}"
        self.keys = folder / "keys"
        self.control_port, board, *listen = udp_ports(4)
        settings, laptop = folder / "robot.toml", folder / "laptop.json"
        settings.write_text(
            f"[board]\nport = {board}\nlisten_ports = {listen}\n"
            f'[sim]\nworld = "empty"\ncontrol_port = {self.control_port}\n',
            encoding="utf-8",
        )
        video = folder / "video.avi"
        write_video(video)
        overlay = {
            "laptop": {"networks": ["site"]},  # there is no other host to connect from
            "camera": {"volumes": [f"{video}:/video.avi:ro"]},
        }
        laptop.write_text(json.dumps({"services": overlay}), encoding="utf-8")
        self.files = [ROOT / name for name in OVERLAYS] + [laptop]
        self.variables = {
            "T2_BASE": base, "T2_TAG": self.name, "T2_CONFIG": str(settings),
            "T2_KEYS": f"{self.keys}/robot.001", "T2_DASHBOARD_PORT": "0",
            "T2_ROUTER_ADDRESS": "127.0.0.1", "T2_ROUTER_PORT": "0", "T2_CAMERA": "/video.avi",
        }  # fmt: skip

    def compose(self, *words: str, **environ: str) -> str:
        """Run a command of Compose."""
        files = [f"--file={file}" for file in self.files]
        profiles = [f"--profile={name}" for name in ("sim", "laptop", "camera")]
        options = (f"--project-name={self.name}", *files, *profiles)
        return run(*compose(), *options, *words, **self.variables | environ)

    def __getitem__(self, service: str) -> Container:
        """Return the container of a service, as it is now."""
        labels = {"project": self.name, "service": service}
        words = [f"--filter=label=com.docker.compose.{k}={v}" for k, v in labels.items()]
        return Container(run("docker", "ps", "--all", "--quiet", "--no-trunc", *words))

    def began(self) -> dict[str, str]:
        """Return the start time of each container."""
        return {name: self[name].state()["StartedAt"] for name in SERVICES}

    def changed(self, before: dict[str, str]) -> list[str]:
        """Return the services that were started again."""
        return [name for name, began in self.began().items() if began != before[name]]

    def wait_healthy(self, service: str) -> None:
        """Wait until the health check of a service passes."""
        state = "the health of " + service
        wait_until(lambda: self[service].state()["Health"]["Status"] == "healthy", state, HEALTHY_S)

    def kill(self, service: str) -> None:
        """Kill all processes of a container, except its init."""
        container = self[service]
        init = container.pid()
        for pid in run("docker", "top", container.name, "-eo", "pid").split()[1:]:
            if pid != init:
                os.kill(int(pid), signal.SIGKILL)


@contextmanager
def started() -> Iterator[Stack]:
    """Build the images and start the containers; remove all of them."""
    base = os.environ.get("T2_BASE", f"t2-base:{frame.SUITE}")
    if attempt("docker", "inspect", base).returncode:
        run("sh", f"{ROOT}/deploy/image/base.sh", base)
    frame.wheelhouse(base, "laptop")
    with tempfile.TemporaryDirectory() as folder:
        stack = Stack(Path(folder), base)
        issue_keys(stack.keys)
        try:
            stack.compose("build")
            stack.compose("up", "--detach", *SERVICES)
            for name in HEALTHY:
                stack.wait_healthy(name)
            with Vehicle(stack["sim"], stack.control_port) as stack.vehicle:
                yield stack
        except BaseException:
            print(stack.compose("logs", "--tail=20"))
            raise
        finally:
            stack.compose("down", "--volumes", "--rmi", "all", "--timeout", "10")
            attempt("docker", "image", "prune", "--force", "--filter", "label=t2.stage=build")
    for kind in ("container", "volume", "network"):
        assert not run("docker", kind, "ls", "--quiet", "--filter", f"name={stack.name}"), kind


def compose() -> list[str]:
    """Return the command of Compose: the plugin of Docker, or the older program."""
    plugin = attempt("docker", "compose", "version").returncode == 0
    return ["docker", "compose"] if plugin else ["docker-compose"]


def issue_keys(folder: Path) -> None:
    """Issue the certificates of a laptop, and of the robot, whose containers can read them."""
    frame.issue_keys(folder, "robot 001 --address router", "viewer anna")
    robot = folder / "robot.001"
    for file in (robot, *robot.iterdir()):
        shutil.chown(file, USER, USER)
    for each in (folder, folder.parent):
        each.chmod(0o711)


def write_video(file: Path) -> None:
    """Write a second of grey pictures."""
    with av.open(file, "w", format="avi") as container:
        stream = container.add_stream("mjpeg", rate=10)
        stream.width, stream.height, stream.pix_fmt = 320, 180, "yuvj420p"
        for _ in range(10):
            container.mux(stream.encode(av.VideoFrame(320, 180, "yuvj420p")))
        container.mux(stream.encode())


# --- the checks -----------------------------------------------------------------------------------


def drives_and_records(stack: Stack) -> str:
    """Drive, stop by emergency stop, drive again; the recorder writes a file."""
    stack.vehicle.drive()
    stack.vehicle.robot.estop()
    wait_until(lambda: stack.vehicle.truth().command.kind == "brake", "BRAKE", STOPS_S)
    stack.vehicle.drive()
    listing = ("python", "-c", "import os; print(os.listdir('/recordings'))")
    pattern = re.compile(r"001-[^']*-latch-[^']*\.mcap")
    found = wait_until(lambda: pattern.search(stack["recorder"].run(*listing)), "a recording")
    return found[0] if found else ""


def image_is_minimal(stack: Stack) -> str:
    """Check that the robot's image is small, and has neither root nor tools."""
    safety = stack["safety"]
    assert safety.run("python", "-c", "import os; print(os.getuid())") == str(USER)
    assert not [each for each in TOOLS if not safety.attempt(each, "--help").returncode]
    size = int(run("docker", "image", "inspect", "--format={{.Size}}", f"t2-robot:{stack.name}"))
    assert size < ROBOT_MB * 1e6, size
    return f"{size / 1e6:.1f} MB, no shell, no installer"


def laptop_connects(stack: Stack) -> str:
    """Query safety from the laptop's container; the dashboard is closed."""
    own = {"T2_KEYS": f"{stack.keys}/viewer.anna", "T2_ROUTER": "tls/router:7447"}
    words = ("run", "--rm", "-T", "laptop", "health", "safety", "--json")
    assert json.loads(stack.compose(*words, T2_USER="0:0", **own))["state"] == "ok"
    page = "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8080')"
    assert "401" in stack["dashboard"].attempt("python", "-c", page).stderr
    return "over TLS; the dashboard requires its token"


def camera_publishes(stack: Stack) -> str:
    """Receive a picture from the camera's container."""
    words = ("echo", "tel/camera/front/picture", "--once", "--json", "--config")
    picture = json.loads(stack["camera"].run("t2", *words, "/etc/t2/robot.toml"))
    assert picture["message"]["width"] == 320
    return "pictures of a file"


def restart_when_killed(stack: Stack) -> str:
    """Kill all processes of a container: the vehicle stops, only that container is restarted."""
    seen = []
    for name in HEALTHY:
        before = stack.began()
        kill = partial(stack.kill, name)
        if name in CHAIN:  # the guard brakes once the bridge's container runs again
            limit_s = RESTARTS_S if name == "bridge" else STOPS_S
            seen.append(f"{name} {stack.vehicle.stops_after(kill, limit_s)}")
        else:
            kill()
        wait_until(partial(stack.changed, before), f"a restarted {name}", RESTARTS_S)
        stack.wait_healthy(name)
        assert stack.changed(before) == [name]
    stack.vehicle.drive()
    return f"{'; '.join(seen)}; drives again"


CHECKS = (
    drives_and_records, image_is_minimal, laptop_connects, camera_publishes, restart_when_killed,
)  # fmt: skip
