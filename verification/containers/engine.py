"""Command lines of Docker and Docker Compose."""

import json
import os
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PATIENCE_S = 300.0
# An unreachable registry may not answer at all.
PULL_S = 60.0


class EngineError(AssertionError):
    """A Docker command failed."""


def docker(*words: str, patience_s: float = PATIENCE_S, check: bool = True) -> str:
    """Run ``docker`` and return its output; raise ``EngineError`` when it fails."""
    return ran(["docker", *words], None, patience_s, check)


def ran(
    command: Sequence[str], env: Mapping[str, str] | None, patience_s: float, check: bool = True
) -> str:
    """Run a command with additional environment variables."""
    try:
        done = subprocess.run(
            command, env=os.environ | (env or {}), capture_output=True, text=True,
            timeout=patience_s, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise EngineError(f"{' '.join(command)}: timeout after {patience_s:.0f} s") from None
    if check and done.returncode:
        output = (done.stdout + done.stderr)[-2000:]
        raise EngineError(f"{' '.join(command)} ended with {done.returncode}: {output}")
    return done.stdout.strip()


def missing() -> str:
    """Return what this machine lacks to run containers; empty when nothing is missing."""
    if shutil.which("docker") is None:
        return "docker is not installed"
    try:
        docker("info", patience_s=30.0)
    except EngineError as failed:
        return f"the Docker engine does not answer: {str(failed).strip().splitlines()[-1]}"
    if not compose():
        return "neither `docker compose` nor docker-compose is installed"
    return ""


def compose() -> list[str]:
    """Return the command of Compose: the plugin of Docker, or the older program."""
    if docker("compose", "version", check=False):
        return ["docker", "compose"]
    return ["docker-compose"] if shutil.which("docker-compose") else []


def pulled(image: str) -> bool:
    """Return whether an image is present or can be pulled."""
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
    """One Compose project: name, files and variables."""

    name: str
    files: Sequence[Path]
    variables: Mapping[str, str]
    profiles: Sequence[str] = ()

    def __call__(self, *words: str, patience_s: float = PATIENCE_S, check: bool = True) -> str:
        """Run a Compose command."""
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
        """Output of ``docker inspect``."""
        about: dict[str, Any] = json.loads(docker("inspect", self.id))[0]
        return about

    @property
    def health(self) -> str:
        """``healthy``, ``unhealthy``, ``starting``; ``none`` without a health check."""
        state = self.about["State"]
        return str(state.get("Health", {}).get("Status", "none")) if state["Running"] else "down"

    @property
    def began(self) -> str:
        """Start time of its processes."""
        return str(self.about["State"]["StartedAt"])

    def run(self, *words: str, check: bool = True) -> str:
        """Run a command in it."""
        return docker("exec", self.id, *words, check=check)

    def python(self, text: str, check: bool = True) -> str:
        """Run Python code in it: there is no shell."""
        return self.run("python", "-c", text, check=check)

    def log(self) -> str:
        """Return its log."""
        return ran(["sh", "-c", f"docker logs {self.id} 2>&1"], None, PATIENCE_S)
