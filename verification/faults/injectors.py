"""Fault injectors: processes, the simulated board, the bus."""

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable

import msgpack
import msgspec
import zenoh

from common import clock, keys
from common.bus.session import client_config
from common.freshness import NS_PER_S
from common.operator import release_request, reset_request
from sim.requests import Asked, Bumper, Mute, ReportName, Sonar, SonarName
from verification.faults.stack_fixture import StackFixture
from verification.harness.bus import at
from verification.harness.process_stats import children
from verification.harness.stack import SETTINGS_FILE
from verification.harness.waiting import becomes_true, wait_until

LATE_S = 1.3  # a reset may be 1.0 s old, a held release 0.4 s
DEATH_S = 1.0  # longer than a kernel needs to end a process


def child(pid: int) -> int:
    """Wait for a child of a process and return it."""
    return wait_until(lambda: children(pid), f"a child of {pid}", 5.0)[0]


def pid_of(fixture: StackFixture, name: str) -> int:
    """Return the pid of a process of the stack.

    ``guard`` is the parent of the bridge; ``teleop`` is a child of the driver process.
    """
    if name in ("bridge", "teleop"):
        return child(fixture.running.processes["bridge" if name == "bridge" else "driver"].pid)
    return fixture.running.processes["bridge" if name == "guard" else name].pid


def kill(name: str, number: signal.Signals) -> Callable[[StackFixture], int]:
    """Send a signal to a process of the stack; measure how long the kernel takes to end it.

    The kernel frees the memory before it closes the pipes, by which other processes notice.
    """

    def inject(fixture: StackFixture) -> int:
        process = os.pidfd_open(pid_of(fixture, name))
        at_ns = clock.now_ns()
        signal.pidfd_send_signal(process, number)
        if number == signal.SIGKILL:
            select.select([process], [], [], DEATH_S)
            fixture.death_s = (clock.now_ns() - at_ns) / NS_PER_S
        os.close(process)
        return at_ns

    return inject


def go_on(name: str) -> Callable[[StackFixture], None]:
    """Continue a stopped process."""
    return lambda fixture: os.kill(pid_of(fixture, name), signal.SIGCONT)


def do(*requests: Asked) -> Callable[[StackFixture], int]:
    """Send requests to the simulated vehicle."""

    def inject(fixture: StackFixture) -> int:
        at_ns = clock.now_ns()
        for request in requests:
            fixture.running.control.do(request)
        return at_ns

    return inject


def in_sequence(*injectors: Callable[[StackFixture], int]) -> Callable[[StackFixture], int]:
    """Inject several faults in sequence; the time of the last one counts."""

    def inject(fixture: StackFixture) -> int:
        return [inject(fixture) for inject in injectors][-1]

    return inject


def silent(report: ReportName, seconds: float) -> Callable[[StackFixture], int]:
    """Suppress a report of the board for some time, then restore it."""

    def inject(fixture: StackFixture) -> int:
        at_ns = do(Mute(reports=(report,)))(fixture)
        time.sleep(seconds)
        fixture.running.control.do(Mute())
        return at_ns

    return inject


def hit(held_s: float) -> Callable[[StackFixture], int]:
    """Press the bumper; the fault time is the first frame that reports it."""

    def inject(fixture: StackFixture) -> int:
        fixture.frames.hits.clear()
        fixture.running.control.do(Bumper(pressed=True))
        becomes_true(lambda: fixture.frames.follow().hits, 2.0)
        time.sleep(held_s)
        fixture.running.control.do(Bumper(pressed=False))
        return fixture.frames.hits[0].mono_ns

    return inject


def late_resets(fixture: StackFixture) -> int:
    """Press the bumper; 20 reset calls that the operator made then arrive too late."""
    at_ns = hit(0.1)(fixture)
    becomes_true(fixture.latched, 2.0)
    assert fixture.state is not None
    late = reset_request(fixture.state)
    fixture.request(0.0)  # safety refuses a reset while motion is requested
    time.sleep(LATE_S)
    for _ in range(20):
        fixture.bus.call(keys.RESET, late, ignored, ignored, 1.0)
    time.sleep(0.3)
    return at_ns


def late_releases(fixture: StackFixture) -> int:
    """Keep the bumper pressed; 20 calls of a held release arrive too late."""
    fixture.frames.hits.clear()
    fixture.running.control.do(Bumper(pressed=True))
    becomes_true(lambda: fixture.frames.follow().hits and fixture.latched(), 2.0)
    late = release_request(fixture.state, "backward", held=True)
    time.sleep(LATE_S)
    for _ in range(20):
        fixture.bus.call(keys.RELEASE, late, ignored, ignored, 1.0)
        time.sleep(0.02)
    fixture.running.control.do(Bumper(pressed=False))
    return fixture.frames.hits[0].mono_ns


def ignored(_: object) -> None:
    """Ignore an answer; the frames at the board decide."""


def estop(fixture: StackFixture) -> int:
    """Publish an E-STOP as the T2 tools do."""
    at_ns = clock.now_ns()
    fixture.bus.estop()
    return at_ns


def estop_by(put: Callable[[zenoh.Session, str], None]) -> Callable[[StackFixture], int]:
    """Publish an E-STOP as a program does that knows only the key."""

    def inject(fixture: StackFixture) -> int:
        with zenoh.open(client_config(at(fixture.running.endpoint))) as session:
            time.sleep(0.1)  # until the router knows the session
            at_ns = clock.now_ns()
            put(session, keys.estop_key("001"))
            time.sleep(0.1)
        return at_ns

    return inject


def second(*words: str) -> Callable[[StackFixture], int]:
    """Start a second instance of a process, or a module, beside the stack."""

    def inject(fixture: StackFixture) -> int:
        at_ns = clock.now_ns()
        command = (
            [*fixture.running.commands[words[0]]] if len(words) == 1 else [sys.executable, *words]
        )
        with fixture.running.log.open("ab") as log:
            fixture.running.others.append(
                subprocess.Popen(command, stdin=subprocess.PIPE, stdout=log, stderr=log)
            )
        return at_ns

    return inject


def end_others(fixture: StackFixture) -> None:
    """End the processes that were started beside the stack."""
    while fixture.running.others:
        process = fixture.running.others.pop()
        process.terminate()
        process.communicate(timeout=20)


def second_driver(fixture: StackFixture) -> int:
    """Start a second driver under the same source name."""
    at_ns = second("-m", "verification.faults.driver", fixture.running.endpoint)(fixture)
    pipe = fixture.running.others[-1].stdin
    assert pipe is not None
    pipe.write(b"0.8\n")
    pipe.flush()
    return at_ns


def flood(fixture: StackFixture) -> int:
    """Send 20 000 datagrams a second to the bridge's first port, from a foreign address."""
    port = fixture.running.config.board.listen_ports[0]
    return second("-m", "verification.faults.flood", str(port))(fixture)


def spoil_config(fixture: StackFixture) -> int:
    """Write an invalid settings file, and kill the bridge."""
    (fixture.folder / SETTINGS_FILE).write_text("[bridge]\nlease = 'endless'\n")
    return kill("bridge", signal.SIGKILL)(fixture)


def restore_config(fixture: StackFixture) -> None:
    """Restore the settings file."""
    becomes_true(lambda: fixture.running.processes["bridge"].poll() is not None, 10.0)
    (fixture.folder / SETTINGS_FILE).write_text("")
    fixture.restore()


def restore_sonar(name: SonarName) -> Callable[[StackFixture], None]:
    """Restore a sonar."""

    def restore(fixture: StackFixture) -> None:
        fixture.running.control.do(Sonar(name=name))

    return restore


def publish(payload: bytes, encoding: str = "application/msgpack") -> Callable[[StackFixture], int]:
    """Publish a payload once on every subscribed key except the E-STOP key, and with every call."""
    topic_keys = [
        topic.on("001", source="teleop", service="safety", side="left") for topic in keys.TOPICS
    ]

    def inject(fixture: StackFixture) -> int:
        with zenoh.open(client_config(at(fixture.running.endpoint))) as session:
            at_ns = clock.now_ns()
            for key in topic_keys:
                session.put(key, payload, encoding=encoding,
                            congestion_control=zenoh.CongestionControl.BLOCK)  # fmt: skip
            for call in keys.CALLS:
                session.get(call.on("001"), payload=payload, timeout=0.2)
            time.sleep(0.2)
        return at_ns

    return inject


MOTION = {"command": "run", "linear": 0.5, "angular": 0.0, "echo": 0, "seq": 1, "boot": 1}
HOSTILE = {
    "no MessagePack": publish(b"\xc1" * 20),
    "nothing": publish(b""),
    "1 MB": publish(msgpack.packb({"text": "x" * 1_000_000})),
    "deep nesting": publish(b"\x81\xa1x" + b"\x91" * 100_000),
    "wrong types": publish(msgpack.packb({name: [] for name in MOTION})),
    "NaN": publish(msgpack.packb(MOTION | {"linear": float("nan"), "angular": float("nan")})),
    "infinity": publish(msgpack.packb(MOTION | {"linear": float("inf")})),
    "negative zero": publish(msgpack.packb(MOTION | {"linear": -0.0, "angular": -0.0})),
    "huge integers": publish(msgpack.packb(MOTION | {"linear": 2**63, "seq": 2**64 - 1})),
    "too fast": publish(msgpack.packb(MOTION | {"linear": 50.0, "seq": 2**62})),
    "JSON": publish(msgspec.json.encode(MOTION), "application/json"),
    "an encoding of text": publish(msgpack.packb(MOTION), "text/plain"),
    "an encoding nobody knows": publish(
        msgpack.packb(MOTION), "x" * 200
    ),  # the longest that Zenoh can send
}


def stall_terminal(seconds: float, held_s: float = 0.3) -> Callable[[StackFixture], int]:
    """Stall the operator's terminal; the key is released meanwhile, its repeats arrive later."""

    def inject(fixture: StackFixture) -> int:
        at_ns = clock.now_ns()
        fixture.send_line(b"stall %f" % seconds)
        time.sleep(held_s)
        fixture.request(0.0)
        return at_ns

    return inject
