"""A simulated robot for tests: the stack as processes, on free ports of this computer."""

import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Literal

from t2.connection import open_session
from t2.errors import LinkError, NoData, Refused
from t2.messages import Cause
from t2.robot import Robot

START_S, END_S, POLL_S = 60.0, 10.0, 0.05
ID = "001"
HOST = "127.0.0.1"
ANSWER_S, LARGEST = 5.0, 65_535  # of the simulator's control socket: time, bytes
# The causes of a robot that waits for a source, or for the third parties in its settings.
READY = {"no_request", "neutral", "limit_silent"}


SonarName = Literal[
    "left", "front_left", "front", "front_right", "right", "rear_right", "rear", "rear_left"
]


STACKS: list["subprocess.Popen[bytes]"] = []  # each ends with its pipe from this process


def _close_pipes() -> None:
    """In a fork: it must not keep the stacks of a dead parent running."""
    for stack in STACKS:
        if stack.stdin:
            stack.stdin.close()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_close_pipes)


class Simulator:
    """The simulated vehicle and its board: what happens to them. Raises ``Refused``.

    >>> with t2.sim() as robot:  # doctest: +SKIP
    ...     robot.simulator.sonar("front", 0.15)
    ...     robot.simulator.press_bumper()
    """

    def __init__(self, port: int) -> None:
        self._port = port

    def press_bumper(self) -> None:
        """Press the bumper strip by hand, until ``free_bumper``."""
        self.do("bumper", pressed=True)

    def free_bumper(self) -> None:
        """Let go of the bumper strip; an obstacle presses it as well."""
        self.do("bumper", pressed=False)

    def sonar(self, name: SonarName, distance: float | None = None, *, fault: bool = False) -> None:
        """Let a sonar report a range in m, or a fault; without either it measures again.

        Safety takes a range that stays while the vehicle moves for a frozen sonar, not for a wall.
        """
        self.do("sonar", name=name, range=distance, fault=fault)

    def freeze(self, seconds: float) -> None:
        """Freeze the board for some seconds: it is silent, and the wheels keep moving."""
        self.do("freeze", seconds=seconds)

    def place(self, x: float, y: float, heading: float = 0.0) -> None:
        """Place the vehicle, m, m, rad in the world, at standstill; odometry does not know."""
        self.do("place", x=x, y=y, heading=heading)

    def truth(self) -> dict[str, Any]:
        """Return the true state: x, y, heading, linear, angular, clearance, contact and more."""
        found: dict[str, Any] = self.do("truth")["truth"]
        return found

    def do(self, what: str, /, **fields: Any) -> dict[str, Any]:
        """Send any request of T2's ``sim/requests.py``; return the answer."""
        # A socket for each: a late answer to an earlier request must not be taken for this one's.
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.settimeout(ANSWER_S)
            sock.connect((HOST, self._port))
            try:
                sock.send(json.dumps({"do": what, **fields}).encode())
                answer: dict[str, Any] = json.loads(sock.recv(LARGEST))
            except OSError as error:
                raise LinkError(f"the simulator does not answer: {error}") from error
        if not answer["ok"]:
            raise Refused(answer["error"])
        return answer


class SimulatedRobot(Robot):
    """A robot of ``t2.sim``, with its ``simulator``.

    >>> with t2.sim() as robot:  # doctest: +SKIP
    ...     robot.simulator.freeze(seconds=1.0)
    """

    simulator: Simulator


@contextmanager
def sim(
    world: str = "empty",
    *,
    sets: Sequence[str] = (),
    configs: Sequence[str | Path] = (),
    command: str = "t2",
) -> Iterator[SimulatedRobot]:
    """Start a simulated robot, yield it when it is ready to drive, and stop it.

    ``world`` is a world of ``t2 sim``; ``sets`` are settings and ``configs`` settings files, as for
    ``t2 up``. ``command`` is T2's command: the one of this environment or of ``PATH``, or a path.
    Other programs connect to ``Robot.endpoint``. Its processes end with this one, however that
    ends. Raises ``LinkError``, with the last lines of its log.

    >>> with t2.sim(world="empty") as robot:  # doctest: +SKIP
    ...     robot.odometry.latest().x
    0.0
    """
    board, first, second, control = _free_ports(4, socket.SOCK_DGRAM)
    (router,) = _free_ports(1, socket.SOCK_STREAM)
    endpoint = f"tcp/{HOST}:{router}"
    own = (
        f"board.port={board}",
        f"board.listen_ports=[{first}, {second}]",
        f"robot.id={ID}",
        f"board.address={HOST}",
        f"board.listen_address={HOST}",
        f"bus.listen={endpoint}",
        "bus.connect=",
        "bus.uplink=",
        f"sim.control_port={control}",
    )
    words = [_found(command), "up", "--until-eof", "--world", world]
    words += [word for each in configs for word in ("--config", str(Path(each).resolve()))]
    words += [word for each in (*own, *sets) for word in ("--set", each)]
    # A folder of its own: a repository may have packages that are named like ours.
    env = {name: it for name, it in os.environ.items() if name not in ("PYTHONPATH", "T2_CONFIG")}
    with tempfile.TemporaryDirectory(prefix="t2-sim-") as folder:
        log = Path(folder) / "log"
        with (
            log.open("wb") as out,
            subprocess.Popen(
                words, cwd=folder, env=env, stdin=subprocess.PIPE, stdout=out, stderr=out
            ) as process,
        ):
            STACKS.append(process)
            try:
                with _connected(endpoint, process, log) as robot:
                    robot.simulator = Simulator(control)
                    yield robot
            finally:
                STACKS.remove(process)
                process.terminate()
                try:
                    process.wait(END_S)
                except subprocess.TimeoutExpired:
                    process.kill()


def waits_for_keepalive(cause: Cause) -> bool:
    """Return whether only the program under test is missing: it keeps an emergency stop alive."""
    return {phrase.name for phrase in cause.phrases} == {"starting.keepalives"}


def _connected(endpoint: str, process: "subprocess.Popen[bytes]", log: Path) -> SimulatedRobot:
    """Return the robot when it is ready to drive."""
    end_s, reason = time.monotonic() + START_S, "no router"
    robot: SimulatedRobot | None = None
    while time.monotonic() < end_s and process.poll() is None:
        try:
            robot = robot or SimulatedRobot(open_session(endpoint, None)[0], ID, endpoint)
            state = robot.safety.latest(timeout=POLL_S)
            robot.odometry.latest(timeout=POLL_S)
            if all(it.name in READY or waits_for_keepalive(it) for it in state.causes):
                return robot
            reason = state.text
        except (LinkError, NoData) as error:
            reason = str(error)
        time.sleep(POLL_S)
    if robot:
        robot.close()
    if process.poll() is not None:
        reason = "its processes ended"
    lines = log.read_text(errors="replace").splitlines()
    lines = [line for line in lines if '"level": "info"' not in line]
    raise LinkError("\n".join([f"the simulated robot did not start: {reason}", *lines[-5:]]))


def _found(command: str) -> str:
    """Return the path of T2's command."""
    beside = os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", "")))
    found = shutil.which(command, path=beside)
    if found is None:
        raise LinkError(
            f"the simulated robot needs the stack, and {command!r} is not found: install T2 here, "
            "or in an environment of its own and pass command="
        )
    return os.path.abspath(found)  # noqa: PTH100 - resolve() would leave the environment


def _free_ports(count: int, kind: socket.SocketKind) -> list[int]:
    with ExitStack() as stack:
        socks = [stack.enter_context(socket.socket(socket.AF_INET, kind)) for _ in range(count)]
        for sock in socks:
            sock.bind((HOST, 0))
        return [sock.getsockname()[1] for sock in socks]
