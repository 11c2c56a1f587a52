"""The frame of the system tests: commands, a computer with systemd, and a vehicle that drives."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import t2
from sim.trace import Truth
from verification.harness.network_hosts import in_network
from verification.harness.stack import Control
from verification.harness.waiting import becomes_true, wait_until

ROOT = Path(__file__).parents[2]
SUITE = os.environ.get("SUITE", "bookworm")  # of Debian, as in deploy/image/base.sh
PACKAGES = "systemd-sysv,dbus,udev,kmod,iproute2,python3"
TOOLS = {"docker": "docker.io", "debootstrap": "debootstrap", "ip": "iproute2"}  # Debian packages
PATIENCE_S, BUILD_S = 60.0, 3600.0
SPEED, MOVING = 0.3, 0.1  # m/s
# Like --privileged, without SYS_RESOURCE, which not every host grants: systemd then skips
# OOMScoreAdjust.
BOOT_OPTIONS = (
    "--cap-add=ALL", "--cap-drop=SYS_RESOURCE", "--security-opt=seccomp=unconfined",
    "--security-opt=apparmor=unconfined", "--security-opt=systempaths=unconfined",
    "--network=none", "--tmpfs=/run", "--tmpfs=/tmp",
)  # fmt: skip
# systemd needs its own cgroup hierarchy, version 2.
BOOT = """
if [ "$(stat -fc %T /sys/fs/cgroup)" != cgroup2fs ]; then
  mount -t cgroup2 none /mnt && mkdir -p /mnt/$0 && echo $$ > /mnt/$0/cgroup.procs && umount /mnt
  exec unshare --cgroup sh -c \
    'umount -R /sys/fs/cgroup; mount -t cgroup2 none /sys/fs/cgroup; exec /sbin/init'
fi
exec /sbin/init
"""


def lacking() -> str:
    """Return what this host lacks for the tests; empty when nothing is missing."""
    if os.geteuid() != 0:
        return "root is required"
    absent = [package for tool, package in TOOLS.items() if not shutil.which(tool)]
    if absent:
        return f"a program is missing: apt install {' '.join(absent)}"
    answer = attempt("docker", "info")
    return f"the Docker engine does not answer: {answer.stderr}" if answer.returncode else ""


def attempt(*words: str, **environ: str) -> "subprocess.CompletedProcess[str]":
    """Run a command to its end."""
    return subprocess.run(
        words,
        env=os.environ | environ,
        capture_output=True,
        text=True,
        timeout=BUILD_S,
        check=False,
    )


def run(*words: str, **environ: str) -> str:
    """Return the output of a command; raise AssertionError when it fails."""
    done = attempt(*words, **environ)
    output = f"{done.stdout}{done.stderr}"[-3000:]
    assert done.returncode == 0, f"{' '.join(words)}: {done.returncode}\n{output}"
    return done.stdout.strip()


class Container:
    """A running container, by its name or id; some boot systemd."""

    def __init__(self, name: str) -> None:
        self.name = name

    def attempt(self, *words: str) -> "subprocess.CompletedProcess[str]":
        """Run a command in it."""
        return attempt("docker", "exec", self.name, *words)

    def run(self, *words: str) -> str:
        """Return the output of a command in it; raise AssertionError when it fails."""
        return run("docker", "exec", self.name, *words)

    def state(self) -> dict[str, Any]:
        """Return its state, as ``docker inspect`` prints it."""
        state: dict[str, Any] = json.loads(
            run("docker", "inspect", "--format={{json .State}}", self.name)
        )
        return state

    def pid(self) -> str:
        """Return the id of its first process on this host."""
        return str(self.state()["Pid"])

    def unit(self, name: str) -> dict[str, str]:
        """Return the properties of a systemd unit."""
        lines = self.run("systemctl", "show", name).splitlines()
        return dict(line.split("=", 1) for line in lines if "=" in line)


@contextmanager
def booted(image: str, *options: str) -> Iterator[Container]:
    """Boot a computer without a network, with further options of ``docker run``."""
    name = f"t2-system-{os.getpid()}"
    options = ("--detach", "--name", name, *BOOT_OPTIONS, *options)
    machine = Container(name)
    try:
        run("docker", "run", *options, image, "/bin/sh", "-c", BOOT, name)
        machine.attempt("systemctl", "is-system-running", "--wait")
        yield machine
    except BaseException:
        print(machine.attempt("journalctl", "-o", "cat", "-n", "60").stdout)
        raise
    finally:
        attempt("docker", "rm", "--force", name)
        for root in Path("/sys/fs/cgroup").rglob(name):
            for folder in (*sorted(root.rglob("*/"), reverse=True), root):
                with suppress(OSError):  # its last process is still ending
                    folder.rmdir()


def debian() -> str:
    """Return an image of a minimal Debian with systemd; it is made once."""
    image = f"t2-debian:{SUITE}"
    if attempt("docker", "inspect", image).returncode:
        with tempfile.TemporaryDirectory() as root:
            run("debootstrap", "--variant=minbase", f"--include={PACKAGES}", SUITE, root)
            run("sh", "-c", f"tar -C {root} -c . | docker import - {image}")
    return image


def wheelhouse(image: str, packages: str) -> None:
    """Build the wheelhouse of a package set for the Python of an image."""
    version = "import sys; print('{}.{}'.format(*sys.version_info))"
    python = run("docker", "run", "--rm", "--entrypoint", "python3", image, "-c", version)
    run("make", "-C", str(ROOT), "wheelhouse", f"SET={packages}", f"WHEEL_PYTHON={python}")


def issue_keys(folder: Path, *members: str) -> None:
    """Issue the certificates of a site."""
    for words in ("init", *(f"issue {member}" for member in members)):
        run(sys.executable, "-m", "cli", "keys", *words.split(), "--folder", str(folder))


class Vehicle:
    """The simulated vehicle of a computer, and a client on board that drives it."""

    def __init__(self, computer: Container, control_port: int) -> None:
        self._proc = f"/proc/{computer.pid()}"
        endpoint = f"unixsock-stream/{self._proc}/root/run/t2/bus.sock"
        self.robot = t2.connect("001", endpoint=endpoint)
        self._drive = self.robot.drive("teleop")
        self._control = Control(control_port, timeout_s=1.0)

    def __enter__(self) -> "Vehicle":
        return self

    def __exit__(self, *_: object) -> None:
        self.robot.close()

    def truth(self) -> Truth:
        """Return the true state of the vehicle, and the command that its board holds."""
        return in_network(f"{self._proc}/ns/net", self._control.truth)

    def drive(self) -> None:
        """Clear latches, and request motion until the vehicle moves."""
        wait_until(self._moves, "a moving vehicle", PATIENCE_S)

    def stops_after(self, fault: Callable[[], object], limit_s: float) -> str:
        """Inject a fault while driving; the board holds RUN no longer than the limit."""
        self.drive()
        began_s = time.monotonic()
        fault()
        wait_until(lambda: self.truth().command.kind != "run", "STOP or BRAKE", limit_s)
        return f"RUN for {time.monotonic() - began_s:.2f} s"

    def _moves(self) -> bool:
        with suppress(t2.T2Error):
            if self.robot.safety.latest().latched:
                self.robot.reset()
            self._drive.close()
            self._drive = self.robot.drive("teleop")
            self._drive.__enter__()
            self._drive.velocity(SPEED, seconds=10.0)  # to stop it before is the fault's part
            return becomes_true(lambda: self.truth().linear > MOVING, 3.0)
        return False
