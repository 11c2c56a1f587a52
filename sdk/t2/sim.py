"""A simulated robot for tests: the stack as processes, on free ports of this computer."""

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

from t2.connection import connect
from t2.errors import LinkError, NoData
from t2.robot import Robot

START_S, END_S, POLL_S = 60.0, 10.0, 0.05
READY = {"no_request", "neutral"}  # the causes of a robot that waits for a source


@contextmanager
def sim(world: str = "empty", *, sets: Sequence[str] = (), command: str = "t2") -> Iterator[Robot]:
    """Start a simulated robot, yield it when it is ready to drive, and stop it.

    ``world`` is a world of ``t2 sim``, ``sets`` are settings as for ``t2 up --set``, ``command`` is
    T2's command: the one of this environment or of ``PATH``, or a path. Other programs connect to
    ``Robot.endpoint``. Raises ``LinkError``, with the last lines of its log.

    >>> with t2.sim(world="empty") as robot:  # doctest: +SKIP
    ...     robot.odometry.latest().x
    0.0
    """
    board, first, second = _free_ports(3, socket.SOCK_DGRAM)
    (router,) = _free_ports(1, socket.SOCK_STREAM)
    endpoint = f"tcp/127.0.0.1:{router}"
    own = (
        f"board.port={board}",
        f"board.listen_ports=[{first}, {second}]",
        f"bus.listen={endpoint}",
    )
    words = [_found(command), "up", "--world", world]
    words += [word for each in (*own, *sets) for word in ("--set", each)]
    # A folder of its own: a repository may have packages that are named like ours.
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    with tempfile.TemporaryDirectory(prefix="t2-sim-") as folder:
        log = Path(folder) / "log"
        with (
            log.open("wb") as out,
            subprocess.Popen(words, cwd=folder, env=env, stdout=out, stderr=out) as process,
        ):
            try:
                with _connected(endpoint, process, log) as robot:
                    yield robot
            finally:
                process.terminate()
                try:
                    process.wait(END_S)
                except subprocess.TimeoutExpired:
                    process.kill()


def _connected(endpoint: str, process: "subprocess.Popen[bytes]", log: Path) -> Robot:
    """Return the robot when it is ready to drive."""
    end_s, reason, robot = time.monotonic() + START_S, "no router", None
    while time.monotonic() < end_s and process.poll() is None:
        try:
            robot = robot or connect(endpoint=endpoint)
            state = robot.safety.latest(timeout=POLL_S)
            robot.odometry.latest(timeout=POLL_S)
            if {cause.name for cause in state.causes} <= READY:
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
            sock.bind(("127.0.0.1", 0))
        return [sock.getsockname()[1] for sock in socks]
