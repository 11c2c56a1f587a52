"""The running containers with a driver; all are removed at the end."""

import io
import json
import shutil
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

from cli.demo import host_stalls
from cli.demo.score import Trace, read
from cli.settings import Everything
from common import settings
from common.config import Sources, load
from common.freshness import NS_PER_S
from sim.requests import Place
from sim.sockets import Control
from verification.containers.driver import LaptopDriver, driving
from verification.containers.engine import Container, Project, docker
from verification.harness.certificates import Site
from verification.harness.ports import free_port, udp_ports
from verification.harness.waiting import wait_until

ROOT = Path(__file__).parents[2]
OVER = ("deploy/compose/own-router.yaml", "deploy/compose/tls.yaml")
HEALTH_CHECKED = (
    "router",
    "bridge",
    "safety",
    "odom",
    "recorder",
    "dashboard",
)  # have a health check
SERVICES = (*HEALTH_CHECKED, "sim")
CONTAINER_USER = 10001
MEASURE_S = 10.0  # long enough to see occasional stalls
UP_S, HEALTHY_S, BUILD_S = 300.0, 180.0, 3600.0


@dataclass(frozen=True)
class Ports:
    """Ports of one run on the host; other stacks may run beside it."""

    board: int
    first: int
    second: int
    control: int
    router: int
    page: int

    @classmethod
    def free(cls) -> "Ports":
        """Return free ports."""
        board, first, second, control = udp_ports(4)
        return cls(board, first, second, control, router=free_port(), page=free_port())

    def settings(self) -> list[str]:
        """Return them as settings of the services."""
        return [
            f"board.port={self.board}",
            f"board.listen_ports={self.first},{self.second}",
            f"sim.control_port={self.control}",
        ]

    def variables(self) -> dict[str, str]:
        """Return them as variables of compose.yaml."""
        return {
            "T2_ROUTER_ADDRESS": "127.0.0.1",
            "T2_ROUTER_PORT": str(self.router),
            "T2_DASHBOARD_PORT": str(self.page),
        }


@dataclass
class StackFixture:
    """The running project and its simulated board."""

    project: Project
    config: Everything  # effective
    stall_s: float  # longest scheduling stall of the host
    trace_file: Path
    ports: Ports
    driver: LaptopDriver
    control: Control

    def __getitem__(self, service: str) -> Container:
        """Return the container of a service, as it is now."""
        return self.project.container(service)

    def trace(self) -> Trace:
        """Return the trace so far."""
        return read(self.trace_file)

    def speed(self) -> float:
        """Return the true speed of the vehicle, in m/s."""
        return self.control.truth().linear

    def holds(self) -> str:
        """Return the kind of the command that the board holds."""
        return self.control.truth().command.kind

    def put_back(self) -> None:
        """Put the vehicle back to its start."""
        self.control.do(Place(x=0.0, y=0.0))

    def wait_healthy(self, *services: str) -> None:
        """Wait until these services are healthy; all when none is named."""
        names = services or HEALTH_CHECKED

        def healthy() -> bool:
            return all(self[name].health == "healthy" for name in names)

        try:
            wait_until(healthy, f"health of {', '.join(names)}", HEALTHY_S)
        except AssertionError as error:
            health = {name: self[name].health for name in names}
            raise AssertionError(f"{error}; {health}") from None


def held_run_s(trace: Trace, since_ns: int) -> float:
    """Return how long after a time the board held a moving command, in seconds."""
    held_ns, moving = since_ns, False
    for command in trace.commands:
        if moving and command.mono_ns > since_ns:
            held_ns = command.mono_ns
        moving = command.kind == "run" and bool(command.linear or command.angular)
    return (held_ns - since_ns) / NS_PER_S


def issue_keys(folder: Path) -> tuple[Path, Path]:
    """Issue certificates with ``t2 keys``; return the folders of the robot and of a driver."""
    robot, driver = folder / "robot.001", folder / "driver.anna"
    with redirect_stdout(io.StringIO()):
        site = Site(folder)
        sources = ("--source", "teleop", "--source", "demo")  # the lap's source is demo
        site.keys("issue", "driver", "anna", "--robot", "001", *sources)
        site.keys("issue", "robot", "001", "--address", "127.0.0.1", "--address", "router")
    for file in (robot, *robot.iterdir()):
        shutil.chown(file, CONTAINER_USER, CONTAINER_USER)
    folder.chmod(0o711)
    return robot, driver


def override(sets: list[str], trace: Path) -> dict[str, object]:
    """Return the override of compose.yaml: settings, and a simulator with a trace."""
    pairs = (text.split("=", 1) for text in sets)
    given = {f"T2__{path.upper().replace('.', '__')}": value for path, value in pairs}
    services: dict[str, dict[str, object]] = {
        name: {"environment": dict(given)} for name in (*SERVICES, "router-settings")
    }
    services["sim"] |= {
        "command": ["sim", "--config", "/etc/t2/robot.toml", "--trace", "/trace/trace.jsonl"],
        "volumes": [{"type": "bind", "source": str(trace), "target": "/trace"}],
    }
    services["laptop"] = {"networks": ["site"]}  # no other host to connect from
    return {"services": services}


@contextmanager
def stack_fixture(
    folder: Path, base: str, tag: str, *, keep: bool = False, built: bool = False
) -> Iterator[StackFixture]:
    """Build and start the containers; ``keep`` keeps the images, ``built`` uses kept images."""
    ports, stall_s = Ports.free(), host_stalls.measured(MEASURE_S)
    robot_keys, driver_keys = issue_keys(folder / "keys")
    sets = [*ports.settings(), *host_stalls.settings(stall_s)]
    trace = folder / "trace"
    trace.mkdir()
    trace.chmod(0o777)  # the containers' user does not exist on the host
    over = folder / "override.json"
    over.write_text(json.dumps(override(sets, trace)), encoding="utf-8")
    project = Project(
        f"t2-{tag}",
        [ROOT / "compose.yaml", *(ROOT / file for file in OVER), over],
        {"T2_BASE": base, "T2_TAG": tag, "T2_KEYS": str(robot_keys), **ports.variables()},
        ["sim"],
    )
    with ExitStack() as stack:
        if not keep:
            stack.callback(remove_images, tag)
        stack.callback(remove, project)
        if not built:
            progress("building the images")
            project("build", patience_s=BUILD_S)
        progress("starting the containers")
        project("up", "-d", patience_s=UP_S)
        yield StackFixture(
            project=project,
            config=load(Everything, Sources(sets=sets)).config,
            stall_s=stall_s,
            trace_file=trace / "trace.jsonl",
            ports=ports,
            driver=stack.enter_context(driving(driver_settings(ports, driver_keys), "001")),
            control=Control(ports.control),
        )


def driver_settings(ports: Ports, folder: Path) -> settings.BusSettings:
    """Return the TLS settings of a certificate folder of ``t2 keys``."""
    return settings.BusSettings(
        connect=(f"tls/127.0.0.1:{ports.router}",),
        ca=str(folder / "ca.pem"),
        certificate=str(folder / "certificate.pem"),
        private_key=str(folder / "private.key"),
    )


def remove(project: Project) -> None:
    """Remove containers, volumes and networks."""
    progress("removing the containers")
    project("down", "--volumes", "--remove-orphans", "--timeout", "10", check=False)


def remove_images(tag: str) -> None:
    """Remove the images of a run and their build stages, except the base."""
    for image in docker("image", "ls", "--quiet", "--filter", f"reference=t2-*:{tag}*").split():
        docker("image", "rm", "--force", image, check=False)
    docker("image", "prune", "--force", "--filter", "label=t2.fixture=build", check=False)


def progress(text: str) -> None:
    """Print a progress message."""
    print(f"{text} ...", file=sys.stderr, flush=True)
