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
import msgspec
import zenoh

from common import keys
from common.bus.session import client_config
from common.freshness import NS_PER_S
from common.operator import release_request, reset_request
from sim.requests import Asked, Bumper, Mute, ReportName, Sonar, SonarName
from verification.faults.stack_fixture import Lane, until
from verification.harness.support import at, wait_until

LATE_S = 1.3  # a reset may be 1.0 s old, a held release 0.4 s
DEATH_S = 1.0  # longer than a kernel needs to end a process


def child(pid: int) -> int:
    """Return the process that a guard watches, once there is one."""
    path = Path(f"/proc/{pid}/task/{pid}/children")
    return int(wait_until(lambda: path.read_text().split(), f"a child of {pid}", 5.0)[0])


def pid_of(lane: Lane, name: str) -> int:
    """Return a process by its part in the stack.

    ``guard`` is the bridge's parent, and ``teleop`` a child of the driver who types.
    """
    if name in ("bridge", "teleop"):
        return child(lane.stack.processes["bridge" if name == "bridge" else "driver"].pid)
    return lane.stack.processes["bridge" if name == "guard" else name].pid


def kill(name: str, number: signal.Signals) -> Callable[[Lane], int]:
    """Send a signal to a part of the stack; note how long the kernel takes to end what is killed.

    It gives back the memory before it closes the pipes, and others notice by these.
    """

    def inject(lane: Lane) -> int:
        process = os.pidfd_open(pid_of(lane, name))
        at_ns = time.monotonic_ns()
        signal.pidfd_send_signal(process, number)
        if number == signal.SIGKILL:
            select.select([process], [], [], DEATH_S)
            lane.death_s = (time.monotonic_ns() - at_ns) / NS_PER_S
        os.close(process)
        return at_ns

    return inject


def go_on(name: str) -> Callable[[Lane], None]:
    """Let a stopped process go on."""
    return lambda lane: os.kill(pid_of(lane, name), signal.SIGCONT)


def do(*requests: Asked) -> Callable[[Lane], int]:
    """Ask the simulated vehicle for something."""

    def inject(lane: Lane) -> int:
        at_ns = time.monotonic_ns()
        for request in requests:
            lane.stack.control.do(request)
        return at_ns

    return inject


def then(*deeds: Callable[[Lane], int]) -> Callable[[Lane], int]:
    """Do one after the other; the last one is the fault."""

    def inject(lane: Lane) -> int:
        return [deed(lane) for deed in deeds][-1]

    return inject


def silent(report: ReportName, seconds: float) -> Callable[[Lane], int]:
    """Let the board leave out a report for a while; what comes of its return is seen, too."""

    def inject(lane: Lane) -> int:
        at_ns = do(Mute(reports=(report,)))(lane)
        time.sleep(seconds)
        lane.stack.control.do(Mute())
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


def late_resets(lane: Lane) -> int:
    """Hit something, and let 20 resets that the operator made then arrive too late."""
    at_ns = hit(0.1)(lane)
    until(lane.latched, 2.0)
    assert lane.state is not None
    late = reset_request(lane.state)
    lane.ask(0.0)  # or the stick that is held would refuse it
    time.sleep(LATE_S)
    for _ in range(20):
        lane.bus.ask(keys.RESET, late, ignored, ignored, 1.0)
    time.sleep(0.3)
    return at_ns


def late_releases(lane: Lane) -> int:
    """Hit something and stay on it, and let 20 calls of a held release arrive too late."""
    lane.frames.hits.clear()
    lane.stack.control.do(Bumper(pressed=True))
    until(lambda: lane.frames.follow().hits and lane.latched(), 2.0)
    late = release_request(lane.state, "backward", held=True)
    time.sleep(LATE_S)
    for _ in range(20):
        lane.bus.ask(keys.RELEASE, late, ignored, ignored, 1.0)
        time.sleep(0.02)
    lane.stack.control.do(Bumper(pressed=False))
    return lane.frames.hits[0].mono_ns


def ignored(_: object) -> None:
    """Take an answer that the frames at the board judge better."""


def estop(lane: Lane) -> int:
    """Stop it as our own tools do."""
    at_ns = time.monotonic_ns()
    lane.bus.estop()
    return at_ns


def estop_by(put: Callable[[zenoh.Session, str], None]) -> Callable[[Lane], int]:
    """Stop it as any program can that knows the key and nothing else."""

    def inject(lane: Lane) -> int:
        with zenoh.open(client_config(at(lane.stack.endpoint))) as session:
            time.sleep(0.1)  # the router knows the session
            at_ns = time.monotonic_ns()
            put(session, keys.estop_key("001"))
            time.sleep(0.1)
        return at_ns

    return inject


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
    at_ns = second("-m", "verification.faults.driver", lane.stack.endpoint)(lane)
    pipe = lane.stack.others[-1].stdin
    assert pipe is not None
    pipe.write(b"0.8\n")
    pipe.flush()
    return at_ns


def flood(lane: Lane) -> int:
    """Send 20 000 datagrams a second to the bridge's first port, from somebody else's address."""
    port = lane.stack.config.board.listen_ports[0]
    return second("-m", "verification.faults.flood", str(port))(lane)


def spoil_config(lane: Lane) -> int:
    """Change the settings under it to what nobody can read, and kill the bridge."""
    (lane.folder / "lane.toml").write_text("[bridge]\nlease = 'for ever'\n")
    return kill("bridge", signal.SIGKILL)(lane)


def restore_config(lane: Lane) -> None:
    """Give the settings back."""
    until(lambda: lane.stack.processes["bridge"].poll() is not None, 10.0)
    (lane.folder / "lane.toml").write_text("")
    lane.mend()


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
        with zenoh.open(client_config(at(lane.stack.endpoint))) as session:
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
    "no MessagePack": say(b"\xc1" * 20),
    "nothing": say(b""),
    "1 MB": say(msgpack.packb({"text": "x" * 1_000_000})),
    "deep nesting": say(b"\x81\xa1x" + b"\x91" * 100_000),
    "wrong types": say(msgpack.packb({name: [] for name in MOTION})),
    "NaN": say(msgpack.packb(MOTION | {"linear": float("nan"), "angular": float("nan")})),
    "infinity": say(msgpack.packb(MOTION | {"linear": float("inf")})),
    "negative zero": say(msgpack.packb(MOTION | {"linear": -0.0, "angular": -0.0})),
    "huge integers": say(msgpack.packb(MOTION | {"linear": 2**63, "seq": 2**64 - 1})),
    "too fast": say(msgpack.packb(MOTION | {"linear": 50.0, "seq": 2**62})),
    "JSON": say(msgspec.json.encode(MOTION), "application/json"),
    "an encoding of text": say(msgpack.packb(MOTION), "text/plain"),
    "an encoding nobody knows": say(
        msgpack.packb(MOTION), "x" * 200
    ),  # more, and Zenoh cannot send it
}


def stall_terminal(seconds: float, held_s: float = 0.3) -> Callable[[Lane], int]:
    """Hold up the operator's terminal; the key is let go meanwhile, and its repeats come after."""

    def inject(lane: Lane) -> int:
        at_ns = time.monotonic_ns()
        lane.tell(b"stall %f" % seconds)
        time.sleep(held_s)
        lane.ask(0.0)
        return at_ns

    return inject
