"""A simulated computer with systemd: a privileged container without a network.

Its image is built from Debian packages once, and kept: ``docker rmi t2-systemd-test:SUITE``.
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
# Like --privileged, without SYS_RESOURCE, which not every host grants: systemd then skips
# OOMScoreAdjust.
RIGHTS = (
    "--cap-add=ALL", "--cap-drop=SYS_RESOURCE", "--security-opt=seccomp=unconfined",
    "--security-opt=apparmor=unconfined", "--security-opt=systempaths=unconfined",
)  # fmt: skip
# systemd needs its own cgroup hierarchy, version 2.
BOOT = """
if [ "$(stat -fc %T /sys/fs/cgroup)" != cgroup2fs ]; then
  mount -t cgroup2 none /mnt && mkdir -p /mnt/NAME && echo $$ > /mnt/NAME/cgroup.procs && umount /mnt
  exec unshare --cgroup sh -c 'umount -R /sys/fs/cgroup; mount -t cgroup2 none /sys/fs/cgroup; exec /sbin/init'
fi
exec /sbin/init
"""  # noqa: E501


def lacking() -> str:
    """Return what this host lacks for the test; empty when nothing is missing."""
    if os.geteuid() != 0:
        return "root is required"
    for tool in ("docker", "debootstrap"):
        if shutil.which(tool) is None:
            return f"{tool} is not installed"
    if subprocess.run(["docker", "info"], capture_output=True, check=False).returncode:
        return "the Docker engine does not answer"
    return ""


def image(suite: str) -> str:
    """Return the image of a minimal Debian with systemd and Python; build it if missing."""
    name = f"{IMAGE}:{suite}"
    if (
        subprocess.run(["docker", "inspect", name], capture_output=True, check=False).returncode
        == 0
    ):
        return name
    print(f"building {name} from Debian packages", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "root"
        subprocess.run(
            ["debootstrap", "--variant=minbase", f"--include={PACKAGES}", suite, root],
            check=True, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        import_root(root, name)
    return name


def import_root(root: Path, name: str) -> None:
    """Make an image of a root file system."""
    archive = root.with_suffix(".tar")
    subprocess.run(["tar", "-C", root, "-cf", archive, "."], check=True)
    subprocess.run(["docker", "import", archive, name], check=True, stdout=subprocess.DEVNULL)
    archive.unlink()


class Machine:
    """The running computer, with root access."""

    def __init__(self, name: str) -> None:
        self.name = name

    def run(self, *words: str) -> str:
        """Return the output of a command; raise AssertionError when it fails."""
        done = self.attempt(*words)
        assert done.returncode == 0, f"{' '.join(words)}: {done.returncode}\n{done.stdout}"
        return done.stdout

    def attempt(self, *words: str) -> "subprocess.CompletedProcess[str]":
        """Run a command; both of its outputs are in ``stdout``."""
        return subprocess.run(
            ["docker", "exec", self.name, *words], text=True, timeout=120, check=False,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip

    def write(self, path: str, text: str) -> None:
        """Write a file; create its folder."""
        into = ["sh", "-c", 'mkdir -p "${0%/*}"; cat > "$0"', path]
        subprocess.run(
            ["docker", "exec", "-i", self.name, *into], input=text, text=True, check=True
        )

    def copy(self, folder: Path, to: str) -> None:
        """Copy a folder to a path that does not exist yet."""
        subprocess.run(["docker", "cp", "--quiet", folder, f"{self.name}:{to}"], check=True)

    def pid(self) -> str:
        """Return the process id of its systemd on this host."""
        words = ["docker", "inspect", "--format", "{{.State.Pid}}", self.name]
        done = subprocess.run(words, capture_output=True, text=True, check=True)
        return done.stdout.strip()

    def unit(self, name: str) -> dict[str, str]:
        """Return the properties of a unit."""
        lines = self.run("systemctl", "show", name).splitlines()
        return dict(line.split("=", 1) for line in lines if "=" in line)

    def truth(self) -> dict[str, float | str]:
        """Return the true speed of the simulated vehicle, and the command that its board holds."""
        code = (
            "import json; from sim.sockets import Control; t = Control(4009, 1.0).truth(); "
            "print(json.dumps({'linear': t.linear, 'holds': t.command.kind}))"
        )
        state: dict[str, float | str] = json.loads(self.python("-c", code))
        return state

    def python(self, *words: str) -> str:
        """Run T2's Python as T2's user; return the output."""
        python = "/opt/t2/current/bin/python"
        return self.run(
            "setpriv", "--reuid=t2", "--regid=t2", "--init-groups", python, "-P", *words
        )


@contextmanager
def booted(image: str, *options: str) -> Iterator[Machine]:
    """Run a computer from an image, with further options of ``docker run``."""
    name = f"{IMAGE}-{os.getpid()}"
    command = [
        "docker", "run", "--detach", "--name", name, *RIGHTS, "--network", "none",
        "--tmpfs", "/run", "--tmpfs", "/tmp", *options,
        image, "/bin/sh", "-c", BOOT.replace("NAME", name),
    ]  # fmt: skip
    try:
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        machine = Machine(name)
        machine.attempt("systemctl", "is-system-running", "--wait")
        yield machine
    finally:
        subprocess.run(["docker", "rm", "--force", name], check=False, stdout=subprocess.DEVNULL)
        remove_cgroups(name)


def remove_cgroups(name: str) -> None:
    """Remove the cgroups that a machine left behind, innermost first."""
    for root in Path("/sys/fs/cgroup").rglob(name):
        for folder in (*sorted(root.rglob("*"), reverse=True), root):
            if folder.is_dir():
                with suppress(OSError):  # its last process is still ending
                    folder.rmdir()
