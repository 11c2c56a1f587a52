"""The robot's host with its stack, and the laptop's host with teleop and dashboard."""

import contextlib
import io
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from common.settings import BusSettings
from sim.requests import Wire
from verification.faults.namespaces import clock, step_clock
from verification.faults.remote_host import net
from verification.faults.stack_fixture import QUICK, StackFixture, driven
from verification.harness.certificates import Site as Keys
from verification.harness.ports import free_port
from verification.harness.stack import SETTINGS_FILE, running_stack
from verification.harness.waiting import wait_until
from verification.roaming import notes
from verification.roaming.notes import Note

AHEAD_S = 3600  # of the laptop's time of day
EVERYTHING = "bus.laptop_rate=1000"  # Hz: no stream is as fast
LIFT_S = 0.8  # teleop wants 0.6 s without a key before one counts again
DASHBOARD_S = 30.0  # until it is up and its viewer has a picture


@dataclass
class Site:
    """Two hosts, the operator's finger, and what both have noted."""

    fixture: StackFixture
    robot_notes: Path
    laptop_notes: Path

    def air(self, *faults: Wire) -> None:
        """Let this happen to the packets between the hosts from now on; nothing else does."""
        for one in (Wire(), *faults):
            self.fixture.disturb_network(one)

    def carried(self) -> int:
        """Return how many bytes the robot has sent towards the laptop so far, headers and all."""
        lines = Path("/proc/self/net/dev").read_text(encoding="ascii").splitlines()
        near = next(line for line in lines if line.strip().startswith("near"))
        return int(near.split(":")[1].split()[8])

    def on_robot(self, since_ns: int, until_ns: int) -> list[Note]:
        """Return what was on the robot's own bus in this time."""
        return notes.read(self.robot_notes, since_ns, until_ns)

    def on_laptop(self, since_ns: int, until_ns: int) -> list[Note]:
        """Return what the laptop has heard and asked in this time."""
        return notes.read(self.laptop_notes, since_ns, until_ns)

    def hears(self, path: str, since_ns: int) -> list[Note]:
        """Return what the laptop has heard on a key from then on."""
        heard = self.on_laptop(since_ns, time.monotonic_ns())
        return [note for note in heard if note.key == path]

    def press_again(self, speed: float) -> None:
        """Lift the finger and put it back, after a reset where one is due."""
        self.fixture.ask(0.0)
        time.sleep(LIFT_S)
        if self.fixture.latched():
            self.fixture.reset()
        self.fixture.ask(speed)


@contextlib.contextmanager
def site(
    folder: Path, *, shipped: bool = True, thinned: bool = True, dashboard: bool = True
) -> Iterator[Site]:
    """Run both hosts while the context lasts; the laptop's clocks are other ones."""
    folder.mkdir(exist_ok=True)
    (folder / SETTINGS_FILE).write_text("")
    robot, laptop = folder / "robot.jsonl", folder / "laptop.jsonl"
    port = free_port()
    with contextlib.redirect_stdout(io.StringIO()):  # what to do with the keys
        keys = Keys(folder / "keys")
        robots = keys.member("robot", "001", "--address", f"{net(port)}.1")
        laptops = words_of(keys.member("driver", "anna", "--robot", "001"))
    env = clock(folder / "laptop")
    step_clock(folder / "laptop", AHEAD_S)
    listen = f'["unixsock-stream/{folder}/bus.sock", "tls/0.0.0.0:{port}"]'
    sets = [*QUICK, *words_of(robots), *([] if thinned else [EVERYTHING])]
    with running_stack(folder, sets=sets, shipped=shipped, listen=listen) as stack:
        command = [
            sys.executable,
            "-m",
            "verification.roaming.observer",
            stack.endpoint,
            str(robot),
        ]
        stack.others.append(subprocess.Popen(command))
        words = [
            "verification.faults.remote_host",
            stack.config.bus.listen[-1],
            "verification.roaming.laptop",
            str(laptop),
        ]
        words += ["dashboard" if dashboard else "alone", *laptops]
        with driven(stack, folder, words, env) as fixture:
            it = Site(fixture, robot, laptop)
            began_ns = time.monotonic_ns()
            wait_until(lambda: it.hears("tel/safety/state", began_ns), "the laptop", DASHBOARD_S)
            yield it


def words_of(member: BusSettings) -> list[str]:
    """Return the settings that use a certificate."""
    named = {
        name: getattr(member, name) for name in ("ca", "certificate", "private_key", "members")
    }
    return [f"bus.{name}={file}" for name, file in named.items()]
