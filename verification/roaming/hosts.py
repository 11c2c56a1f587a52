"""Two hosts: the robot with its stack, the laptop with teleop and dashboard."""

import contextlib
import io
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from common import clock
from common.settings import BusSettings
from sim.requests import Wire
from verification.faults.namespaces import clock as shifted
from verification.faults.namespaces import step_clock
from verification.faults.remote_host import net
from verification.faults.stack_fixture import QUICK, StackFixture, driven
from verification.harness.certificates import Site as Keys
from verification.harness.ports import free_port
from verification.harness.stack import SETTINGS_FILE, running_stack
from verification.harness.waiting import wait_until
from verification.roaming import message_log
from verification.roaming.message_log import Entry

AHEAD_S = 3600  # of the laptop's time of day
EVERYTHING = "bus.laptop_rate=1000"  # Hz: above all stream rates
RELEASE_S = 0.8  # teleop needs 0.6 s without a key before a new press counts
DASHBOARD_S = 30.0  # until it serves its viewer


@dataclass
class TwoHosts:
    """Both hosts, the operator's key presses, and both message logs."""

    fixture: StackFixture
    robot_log: Path
    laptop_log: Path

    def disturb(self, *faults: Wire) -> None:
        """Set the faults of the link from now on."""
        for one in (Wire(), *faults):
            self.fixture.disturb_network(one)

    def carried(self) -> int:
        """Return the bytes that the robot has sent to the laptop, with headers."""
        lines = Path("/proc/self/net/dev").read_text(encoding="ascii").splitlines()
        near = next(line for line in lines if line.strip().startswith("near"))
        return int(near.split(":")[1].split()[8])

    def on_robot(self, since_ns: int, until_ns: int) -> list[Entry]:
        """Return the messages on the robot's bus in this period."""
        return message_log.read(self.robot_log, since_ns, until_ns)

    def on_laptop(self, since_ns: int, until_ns: int) -> list[Entry]:
        """Return the messages that the laptop received and sent in this period."""
        return message_log.read(self.laptop_log, since_ns, until_ns)

    def received(self, path: str, since_ns: int) -> list[Entry]:
        """Return the messages that the laptop received on a key since then."""
        entries = self.on_laptop(since_ns, clock.now_ns())
        return [entry for entry in entries if entry.key == path]

    def press_again(self, speed: float) -> None:
        """Release the key, reset if due, and press the key again."""
        self.fixture.request(0.0)
        time.sleep(RELEASE_S)
        if self.fixture.latched():
            self.fixture.reset()
        self.fixture.request(speed)


@contextlib.contextmanager
def two_hosts(
    folder: Path, *, shipped: bool = True, downsampled: bool = True, dashboard: bool = True
) -> Iterator[TwoHosts]:
    """Run both hosts; the laptop's clocks differ from the robot's."""
    folder.mkdir(exist_ok=True)
    (folder / SETTINGS_FILE).write_text("")
    robot, laptop = folder / "robot.jsonl", folder / "laptop.jsonl"
    port = free_port()
    with contextlib.redirect_stdout(io.StringIO()):  # instructions of `t2 keys`
        keys = Keys(folder / "keys")
        robots = keys.member("robot", "001", "--address", f"{net(port)}.1")
        laptops = certificate_sets(keys.member("driver", "anna", "--robot", "001"))
    env = shifted(folder / "laptop")
    step_clock(folder / "laptop", AHEAD_S)
    listen = f'["unixsock-stream/{folder}/bus.sock", "tls/0.0.0.0:{port}"]'
    sets = [*QUICK, *certificate_sets(robots), *([] if downsampled else [EVERYTHING])]
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
            it = TwoHosts(fixture, robot, laptop)
            began_ns = clock.now_ns()
            wait_until(lambda: it.received("tel/safety/state", began_ns), "the laptop", DASHBOARD_S)
            yield it


def certificate_sets(member: BusSettings) -> list[str]:
    """Return the settings that use a certificate."""
    named = {
        name: getattr(member, name) for name in ("ca", "certificate", "private_key", "members")
    }
    return [f"bus.{name}={file}" for name, file in named.items()]
