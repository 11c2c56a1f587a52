"""Docker and docker-compose, by their command lines."""

import json
import os
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PATIENCE_S = 300.0
# A registry that cannot be reached may also be one that does not answer.
PULL_S = 60.0


class EngineError(AssertionError):
    """A command of Docker's ended with an error."""


def docker(*words: str, patience_s: float = PATIENCE_S, check: bool = True) -> str:
    """Run ``docker`` and return what it says; raise ``EngineError`` when it ends with an error."""
    return ran(["docker", *words], None, patience_s, check)


def ran(
    command: Sequence[str], env: Mapping[str, str] | None, patience_s: float, check: bool = True
) -> str:
    """Run a command; with ``env`` over this process's own environment."""
    try:
        done = subprocess.run(
            command, env=os.environ | (env or {}), capture_output=True, text=True,
            timeout=patience_s, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise EngineError(f"{' '.join(command)}: no end after {patience_s:.0f} s") from None
    if check and done.returncode:
        said = (done.stdout + done.stderr)[-2000:]
        raise EngineError(f"{' '.join(command)} ended with {done.returncode}: {said}")
    return done.stdout.strip()


def missing() -> str:
    """Say what this machine lacks to run containers; nothing when it has all."""
    if shutil.which("docker") is None:
        return "there is no docker"
    try:
        docker("info", patience_s=30.0)
    except EngineError as failed:
        return f"no Docker engine answers: {str(failed).strip().splitlines()[-1]}"
    if not compose():
        return "there is neither `docker compose` nor docker-compose"
    return ""


def compose() -> list[str]:
    """Return how compose is called here: the plugin of Docker, or the program before it."""
    if docker("compose", "version", check=False):
        return ["docker", "compose"]
    return ["docker-compose"] if shutil.which("docker-compose") else []


def pulled(image: str) -> bool:
    """Tell whether a registry gives an image, or this machine has it."""
    if docker("image", "ls", "--quiet", image):
        return True
    try:
        docker("pull", "--quiet", image, patience_s=PULL_S)
    except EngineError:
        return False
    return True


def size_mb(image: str) -> float:
    """Return the size of an image, in MB of its files."""
    return float(json.loads(docker("image", "inspect", image))[0]["Size"]) / 1e6


@dataclass(frozen=True, slots=True)
class Project:
    """One compose project: its files, what its variables are, and a name of its own."""

    name: str
    files: Sequence[Path]
    variables: Mapping[str, str]
    profiles: Sequence[str] = ()

    def __call__(self, *words: str, patience_s: float = PATIENCE_S, check: bool = True) -> str:
        """Run compose on it."""
        files = [word for file in self.files for word in ("-f", str(file))]
        profiles = [word for profile in self.profiles for word in ("--profile", profile)]
        command = [*compose(), "-p", self.name, *files, *profiles, *words]
        return ran(command, self.variables, patience_s, check)

    def container(self, service: str) -> "Container":
        """Return the container of a service, running or not."""
        label = "label=com.docker.compose"
        ids = docker(
            "ps", "--all", "--quiet", "--no-trunc", "--filter", f"{label}.project={self.name}",
            "--filter", f"{label}.service={service}",
        ).split()  # fmt: skip
        if not ids:
            raise EngineError(f"{service} has no container")
        return Container(ids[0])


@dataclass(frozen=True, slots=True)
class Container:
    """One container, by its id."""

    id: str

    @property
    def about(self) -> dict[str, Any]:
        """All that the engine knows of it."""
        about: dict[str, Any] = json.loads(docker("inspect", self.id))[0]
        return about

    @property
    def health(self) -> str:
        """``healthy``, ``unhealthy``, ``starting``; ``none`` where nobody asks."""
        state = self.about["State"]
        return str(state.get("Health", {}).get("Status", "none")) if state["Running"] else "down"

    @property
    def began(self) -> str:
        """When its processes were started."""
        return str(self.about["State"]["StartedAt"])

    def run(self, *words: str, check: bool = True) -> str:
        """Run a command in it."""
        return docker("exec", self.id, *words, check=check)

    def python(self, text: str, check: bool = True) -> str:
        """Run a piece of Python in it: there is no shell."""
        return self.run("python", "-c", text, check=check)

    def log(self) -> str:
        """Return all that its processes have said."""
        return ran(["sh", "-c", f"docker logs {self.id} 2>&1"], None, PATIENCE_S)
