"""The containers on their stage: built, up, with a driver at the wheel, and nothing left behind."""

import json
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from cli.demo import host_stalls
from cli.demo.score import Trace, read
from cli.settings import Everything
from common import settings
from common.config import Sources, load
from common.freshness import NS_PER_S
from sim.control import Control
from sim.requests import Place
from verification.containers.certificates import Keyring
from verification.containers.engine import Container, Project, docker
from verification.containers.ports import Ports
from verification.containers.wheel import Wheel, wheel
from verification.harness.waiting import wait_until

ROOT = Path(__file__).parents[2]
OVER = ("deploy/compose/own-router.yaml", "deploy/compose/tls.yaml")
ASKED = ("router", "bridge", "safety", "odom", "recorder", "dashboard")  # have a health check
SERVICES = (*ASKED, "sim")
MEASURE_S = 10.0  # some minutes follow: what holds up now and then has to be seen
UP_S, HEALTHY_S, BUILD_S = 300.0, 180.0, 3600.0


@dataclass
class Stage:
    """What the looks look at."""

    project: Project
    config: Everything  # in force
    holdup_s: float  # how long this machine holds processes up
    trace_file: Path
    ports: Ports
    wheel: Wheel
    control: Control

    def __getitem__(self, service: str) -> Container:
        """Return the container of a service, as it is now."""
        return self.project.container(service)

    def trace(self) -> Trace:
        """Return what the simulated board has written down so far."""
        return read(self.trace_file)

    def speed(self) -> float:
        """Return how fast the vehicle really is, in m/s."""
        return self.control.truth().linear

    def holds(self) -> str:
        """Return the kind of the command that the board holds."""
        return self.control.truth().command.kind

    def put_back(self) -> None:
        """Put the vehicle back to where it began."""
        self.control.do(Place(x=0.0, y=0.0))

    def wait_well(self, *services: str) -> None:
        """Wait until these say themselves that they fare well; all of them when none is named."""
        names = services or ASKED

        def well() -> bool:
            return all(self[name].health == "healthy" for name in names)

        try:
            wait_until(well, f"health of {', '.join(names)}", HEALTHY_S)
        except AssertionError as error:
            health = {name: self[name].health for name in names}
            raise AssertionError(f"{error}; {health}") from None


def held_run_s(trace: Trace, since_ns: int) -> float:
    """Return for how long after a moment the board held a command to move, in seconds."""
    held_ns, moving = since_ns, False
    for command in trace.commands:
        if moving and command.mono_ns > since_ns:
            held_ns = command.mono_ns
        moving = command.kind == "run" and bool(command.linear or command.angular)
    return (held_ns - since_ns) / NS_PER_S


def override(sets: list[str], trace: Path) -> dict[str, object]:
    """Return what is put over compose.yaml: settings, and a simulator that writes down."""
    pairs = (text.split("=", 1) for text in sets)
    given = {f"T2__{path.upper().replace('.', '__')}": value for path, value in pairs}
    services: dict[str, dict[str, object]] = {
        name: {"environment": dict(given)} for name in (*SERVICES, "router-settings")
    }
    services["sim"] |= {
        "command": ["sim", "--config", "/etc/t2/robot.toml", "--trace", "/trace/trace.jsonl"],
        "volumes": [{"type": "bind", "source": str(trace), "target": "/trace"}],
    }
    services["laptop"] = {"networks": ["site"]}  # there is no other host here to come in from
    return {"services": services}


@contextmanager
def staged(
    folder: Path, base: str, tag: str, *, keep: bool = False, built: bool = False
) -> Iterator[Stage]:
    """Build, bring up and sit at the wheel; ``keep`` leaves the images, ``built`` takes them."""
    ports, keyring, holdup_s = (
        Ports.free(),
        Keyring(folder / "keys"),
        host_stalls.measured(MEASURE_S),
    )
    sets = [*ports.settings(), *host_stalls.settings(holdup_s)]
    trace = folder / "trace"
    trace.mkdir()
    trace.chmod(0o777)  # the containers' user is nobody here
    over = folder / "override.json"
    over.write_text(json.dumps(override(sets, trace)), encoding="utf-8")
    project = Project(
        f"t2-{tag}",
        [ROOT / "compose.yaml", *(ROOT / file for file in OVER), over],
        {"T2_BASE": base, "T2_TAG": tag, "T2_KEYS": str(keyring.robot), **ports.variables()},
        ["sim"],
    )
    with ExitStack() as stack:
        if not keep:
            stack.callback(remove_images, tag)
        stack.callback(leave, project)
        if not built:
            say("building the images")
            project("build", patience_s=BUILD_S)
        say("bringing all up")
        project("up", "-d", patience_s=UP_S)
        yield Stage(
            project=project,
            config=load(Everything, Sources(sets=sets)).config,
            holdup_s=holdup_s,
            trace_file=trace / "trace.jsonl",
            ports=ports,
            wheel=stack.enter_context(wheel(dialled(ports, keyring.driver), "001")),
            control=Control(ports.control),
        )


def dialled(ports: Ports, folder: Path) -> settings.BusSettings:
    """Return how somebody with this folder of ``t2 keys`` comes in."""
    return settings.BusSettings(
        connect=(f"tls/127.0.0.1:{ports.router}",),
        ca=str(folder / "ca.pem"),
        certificate=str(folder / "certificate.pem"),
        private_key=str(folder / "private.key"),
    )


def leave(project: Project) -> None:
    """Take all down that was put up."""
    say("taking all down")
    project("down", "--volumes", "--remove-orphans", "--timeout", "10", check=False)


def remove_images(tag: str) -> None:
    """Remove the images of a run, and what they were built from, but for the base."""
    for image in docker("image", "ls", "--quiet", "--filter", f"reference=t2-*:{tag}*").split():
        docker("image", "rm", "--force", image, check=False)
    docker("image", "prune", "--force", "--filter", "label=t2.stage=build", check=False)


def say(text: str) -> None:
    """Tell whoever waits what is going on."""
    print(f"{text} ...", file=sys.stderr, flush=True)
