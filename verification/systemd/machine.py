"""A computer with a systemd of its own: a container with rights and without a network.

Its image is made of Debian's packages, once, and stays: ``docker rmi t2-systemd-test:SUITE``.
"""

import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

IMAGE = "t2-systemd-test"
PACKAGES = "systemd,systemd-sysv,dbus,python3"
# As --privileged, but for one that not every machine has to give: OOMScoreAdjust is skipped then.
RIGHTS = (
    "--cap-add=ALL", "--cap-drop=SYS_RESOURCE", "--security-opt=seccomp=unconfined",
    "--security-opt=apparmor=unconfined", "--security-opt=systempaths=unconfined",
)  # fmt: skip
# systemd wants a hierarchy of control groups for itself, of the second version.
BOOT = """
if [ "$(stat -fc %T /sys/fs/cgroup)" != cgroup2fs ]; then
  mount -t cgroup2 none /mnt && mkdir -p /mnt/NAME && echo $$ > /mnt/NAME/cgroup.procs && umount /mnt
  exec unshare --cgroup sh -c 'umount -R /sys/fs/cgroup; mount -t cgroup2 none /sys/fs/cgroup; exec /sbin/init'
fi
exec /sbin/init
"""  # noqa: E501


def lacking() -> str:
    """Return what this machine lacks for the test, or nothing."""
    if os.geteuid() != 0:
        return "it wants root"
    for tool in ("docker", "debootstrap"):
        if shutil.which(tool) is None:
            return f"there is no {tool} here"
    if subprocess.run(["docker", "info"], capture_output=True, check=False).returncode:
        return "no Docker engine answers"
    return ""


def image(suite: str) -> str:
    """Return the image of a bare Debian with systemd and Python, made when there is none."""
    name = f"{IMAGE}:{suite}"
    if (
        subprocess.run(["docker", "inspect", name], capture_output=True, check=False).returncode
        == 0
    ):
        return name
    print(f"making {name} of Debian's packages", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "root"
        subprocess.run(
            ["debootstrap", "--variant=minbase", f"--include={PACKAGES}", suite, root],
            check=True, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        archive = Path(folder) / "root.tar"
        subprocess.run(["tar", "-C", root, "-cf", archive, "."], check=True)
        subprocess.run(["docker", "import", archive, name], check=True, stdout=subprocess.DEVNULL)
    return name


class Machine:
    """The running computer, as root sees it."""

    def __init__(self, name: str) -> None:
        self.name = name

    def said(self, *words: str) -> str:
        """Return what a command says; its standard error when it fails is ours."""
        done = self.tried(*words)
        assert done.returncode == 0, f"{' '.join(words)}: {done.returncode}\n{done.stdout}"
        return done.stdout

    def tried(self, *words: str) -> "subprocess.CompletedProcess[str]":
        """Run a command to its end; both of its outputs are in ``stdout``."""
        return subprocess.run(
            ["docker", "exec", self.name, *words], text=True, timeout=120, check=False,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip

    def write(self, path: str, text: str) -> None:
        """Write a file, and its folder."""
        into = ["sh", "-c", 'mkdir -p "${0%/*}"; cat > "$0"', path]
        subprocess.run(
            ["docker", "exec", "-i", self.name, *into], input=text, text=True, check=True
        )

    def carry(self, folder: Path, to: str) -> None:
        """Copy a folder to a place that does not exist yet."""
        subprocess.run(["docker", "cp", "--quiet", folder, f"{self.name}:{to}"], check=True)

    def unit(self, name: str) -> dict[str, str]:
        """Return the properties of a unit."""
        lines = self.said("systemctl", "show", name).splitlines()
        return dict(line.split("=", 1) for line in lines if "=" in line)

    def truth(self) -> dict[str, float | str]:
        """Return how the simulated vehicle really is: its speed, and what its board holds."""
        code = (
            "import json; from sim.control import Control; t = Control(4009, 1.0).truth(); "
            "print(json.dumps({'linear': t.linear, 'holds': t.command.kind}))"
        )
        told: dict[str, float | str] = json.loads(self.python("-c", code))
        return told

    def python(self, *words: str) -> str:
        """Return what T2's Python says, run as T2's user."""
        python = "/opt/t2/current/bin/python"
        return self.said(
            "setpriv", "--reuid=t2", "--regid=t2", "--init-groups", python, "-P", *words
        )


@contextmanager
def booted(suite: str, wheelhouse: Path) -> Iterator[Machine]:
    """Run a computer while the context lasts; what was carried to it is in /wheelhouse."""
    name = f"{IMAGE}-{os.getpid()}"
    command = [
        "docker", "run", "--detach", "--name", name, *RIGHTS, "--network", "none",
        "--tmpfs", "/run", "--tmpfs", "/tmp",
        "--volume", f"{wheelhouse}:/wheelhouse:ro",
        image(suite), "/bin/sh", "-c", BOOT.replace("NAME", name),
    ]  # fmt: skip
    try:
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        machine = Machine(name)
        machine.tried("systemctl", "is-system-running", "--wait")
        yield machine
    finally:
        subprocess.run(["docker", "rm", "--force", name], check=False, stdout=subprocess.DEVNULL)
        forget(name)


def forget(name: str) -> None:
    """Remove the control groups that a machine has left; the innermost go first."""
    for root in Path("/sys/fs/cgroup").rglob(name):
        for folder in (*sorted(root.rglob("*"), reverse=True), root):
            if folder.is_dir():
                with suppress(OSError):  # its last process is still on its way
                    folder.rmdir()
