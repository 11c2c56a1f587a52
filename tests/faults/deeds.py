"""How faults are made: to processes, to the simulated board, on the bus, to the machine."""

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import msgpack
import zenoh

from common import keys
from common.bus.session import client_config
from sim.requests import Bumper, Driver, Freeze, PowerCycle, Sonar, SonarName, Wire
from tests.faults.lane import Lane, until


def child(pid: int) -> int:
    """Return the process that a guard watches, once there is one."""
    path = Path(f"/proc/{pid}/task/{pid}/children")
    until(lambda: path.read_text().split(), 5.0)
    return int(path.read_text().split()[0])


def pid_of(lane: Lane, name: str) -> int:
    """Return a process by its part in the stack; ``guard`` is the bridge's parent."""
    if name == "bridge":
        return child(lane.stack.processes["bridge"].pid)
    return lane.stack.processes["bridge" if name == "guard" else name].pid


def kill(name: str, number: signal.Signals) -> Callable[[Lane], int]:
    """Send a signal to a part of the stack."""

    def inject(lane: Lane) -> int:
        pid = pid_of(lane, name)
        at_ns = time.monotonic_ns()
        os.kill(pid, number)
        return at_ns

    return inject


def go_on(name: str) -> Callable[[Lane], None]:
    """Let a stopped process go on."""
    return lambda lane: os.kill(pid_of(lane, name), signal.SIGCONT)


def do(*requests: Bumper | Driver | Freeze | PowerCycle | Sonar | Wire) -> Callable[[Lane], int]:
    """Ask the simulated vehicle for something."""

    def inject(lane: Lane) -> int:
        at_ns = time.monotonic_ns()
        for request in requests:
            lane.stack.control.do(request)
        return at_ns

    return inject


def hit(held_s: float) -> Callable[[Lane], int]:
    """Press the bumper; the fault is the first frame that says so."""

    def inject(lane: Lane) -> int:
        lane.frames.hits.clear()
        lane.stack.control.do(Bumper(pressed=True))
        until(lambda: lane.frames.follow().hits, 2.0)
        time.sleep(held_s)
        lane.stack.control.do(Bumper(pressed=False))
        return lane.frames.hits[0].mono_ns

    return inject


def estop(lane: Lane) -> int:
    at_ns = time.monotonic_ns()
    lane.bus.estop()
    return at_ns


def second(*words: str) -> Callable[[Lane], int]:
    """Start one more of something beside what runs, until the fault is mended."""

    def inject(lane: Lane) -> int:
        at_ns = time.monotonic_ns()
        command = [*lane.stack.commands[words[0]]] if len(words) == 1 else [sys.executable, *words]
        with lane.stack.log.open("ab") as log:
            lane.stack.others.append(
                subprocess.Popen(command, stdin=subprocess.PIPE, stdout=log, stderr=log)
            )
        return at_ns

    return inject


def end_others(lane: Lane) -> None:
    """End what was started beside the stack."""
    while lane.stack.others:
        process = lane.stack.others.pop()
        process.terminate()
        process.communicate(timeout=20)


def second_driver(lane: Lane) -> int:
    """Let somebody else ask under the same source's name."""
    at_ns = second("-m", "tests.faults.driver", lane.stack.endpoint)(lane)
    pipe = lane.stack.others[-1].stdin
    assert pipe is not None
    pipe.write(b"0.8\n")
    pipe.flush()
    return at_ns


def flood(lane: Lane) -> int:
    """Send 20 000 datagrams a second to the bridge's first port, from somebody else's address."""
    port = lane.stack.config.board.listen_ports[0]
    return second("-m", "tests.faults.flood", str(port))(lane)


def spoil_config(lane: Lane) -> int:
    """Change the settings under it to what nobody can read, and kill the bridge."""
    (lane.folder / "lane.toml").write_text("[bridge]\nlease = 'for ever'\n")
    return kill("bridge", signal.SIGKILL)(lane)


def restore_config(lane: Lane) -> None:
    """Give the settings back."""
    until(lambda: lane.stack.processes["bridge"].poll() is not None, 10.0)
    (lane.folder / "lane.toml").write_text("")
    lane.mend()


def starve(lane: Lane) -> int:
    """Let the kernel kill the bridge for want of memory, in a group of its own."""
    pid = pid_of(lane, "bridge")
    group = Path(f"/sys/fs/cgroup/memory/t2-faults-{os.getpid()}")
    group.mkdir(exist_ok=True)
    (group / "memory.limit_in_bytes").write_text(str(64 << 20))
    Path(f"/proc/{pid}/oom_score_adj").write_text("1000")
    (group / "cgroup.procs").write_text(str(pid))
    hungry = "import os; x = []\nwhile True: x.append(os.urandom(1 << 20))"
    waiting = os.pidfd_open(pid)
    with subprocess.Popen(
        [sys.executable, "-c", hungry],
        preexec_fn=lambda: (group / "cgroup.procs").write_text(str(os.getpid())),
    ) as eater:
        at_ns = time.monotonic_ns()
        while not select.select([waiting], [], [], 0.0005)[0]:
            at_ns = time.monotonic_ns()  # it was alive then
        eater.kill()
    os.close(waiting)
    return at_ns


def no_starving() -> str:
    """Return why memory cannot be withheld here; empty when it can."""
    root = Path("/sys/fs/cgroup/memory")
    if not os.access(root, os.W_OK) or not (root / "memory.limit_in_bytes").exists():
        return "no memory control group can be made here"
    return ""


def sonar_well(name: SonarName) -> Callable[[Lane], None]:
    """Let a sonar see the world again."""

    def mend(lane: Lane) -> None:
        lane.stack.control.do(Sonar(name=name))

    return mend


def say(payload: bytes, encoding: str = "application/msgpack") -> Callable[[Lane], int]:
    """Let a stranger say this once on every key that anybody reads, but the emergency stop's."""
    whole = [
        topic.on("001", source="teleop", service="safety", side="left") for topic in keys.TOPICS
    ]

    def inject(lane: Lane) -> int:
        with zenoh.open(client_config([lane.stack.endpoint])) as session:
            at_ns = time.monotonic_ns()
            for key in whole:
                session.put(key, payload, encoding=encoding,
                            congestion_control=zenoh.CongestionControl.BLOCK)  # fmt: skip
            for call in keys.CALLS:
                session.get(call.on("001"), payload=payload, timeout=0.2)
            time.sleep(0.2)
        return at_ns

    return inject


MOTION = {"command": "run", "linear": 0.5, "angular": 0.0, "echo": 0, "seq": 1, "boot": 1}
HOSTILE = {
    "no MessagePack": b"\xc1" * 20,
    "1 MB": msgpack.packb({"text": "x" * 1_000_000}),
    "deep nesting": b"\x81\xa1x" + b"\x91" * 100_000,
    "wrong types": msgpack.packb({name: [] for name in MOTION}),
    "NaN": msgpack.packb(MOTION | {"linear": float("nan"), "angular": float("nan")}),
    "infinity": msgpack.packb(MOTION | {"linear": float("inf")}),
    "negative zero": msgpack.packb(MOTION | {"linear": -0.0, "angular": -0.0}),
    "huge integers": msgpack.packb(MOTION | {"linear": 2**63, "seq": 2**64 - 1}),
    "too fast": msgpack.packb(MOTION | {"linear": 50.0, "seq": 2**62}),
}
