"""Fault injectors for processes, the board, the environment, the operator and the bus."""

import contextlib
import os
import random
import select
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, Literal, ParamSpec, TypeVar

import msgpack
import zenoh

from common import clock
from common.freshness import NS_PER_S
from sim.requests import Asked, Bumper
from t2 import keys
from verification.faults.fault import Injector
from verification.faults.independent_client import ROOT, VELOCITY, Client, Map, session
from verification.faults.namespaces import step_clock
from verification.faults.stack_fixture import StackFixture, operators_endpoint
from verification.harness.dashboard import dashboard, flooded
from verification.harness.network_hosts import ip
from verification.harness.process_stats import children
from verification.harness.waiting import becomes_true, wait_until

P = ParamSpec("P")
R = TypeVar("R", bound=int | None)

LATE_S = 1.3  # a reset may be 1.0 s old, a request 0.4 s
DEATH_S = 1.0  # longer than a kernel needs to end a process
FORGED_S = 0.6
AHEAD = 1000
SETTLE_S = 1.0  # until an abuse takes effect
FULL = b"x" * 4096
FLOOD = """
import socket, sys, time
sock, due_s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), time.monotonic()
while True:
    for _ in range(20):
        sock.sendto(b"GS" + bytes(20), ("127.0.0.1", int(sys.argv[1])))
    due_s = max(due_s + 0.001, time.monotonic() - 0.1)
    time.sleep(max(0.0, due_s - time.monotonic()))
"""
NOT_ON_THE_PC = ("sim", "relay", "driver")
QUERIES = """
import sys
from verification.faults.independent_client import ROOT, session
with session(sys.argv[1]) as bus:
    while True:
        for replies in [bus.get(f"{ROOT}/info/*/schema", timeout=0.25) for _ in range(80)]:
            for _ in replies:
                pass
"""
# Of a source that may drive, of unknown ones, and garbage; 1,000 of each a second.
REQUESTS = """
import sys, time, msgpack
from verification.faults.independent_client import ROOT, session
drive, seq = {"linear": 0.0, "angular": 0.0, "echo": 0, "boot": 7}, 0
with session(sys.argv[1]) as bus:
    while True:
        for _ in range(10):
            seq += 1
            message = msgpack.packb(drive | {"seq": seq, "linear": 0.3 * (seq % 2)})
            bus.put(f"{ROOT}/@cmd/drive/nav", message)
            bus.put(f"{ROOT}/@cmd/drive/nobody{seq % 50}", message)
            bus.put(f"{ROOT}/@cmd/drive/nav", bytes([0xC1]) * 40)
        time.sleep(0.01)
"""
SESSIONS = """
import contextlib, sys, time
from verification.faults.independent_client import session
with contextlib.ExitStack() as held:
    while True:
        try:
            held.enter_context(session(sys.argv[1]))
        except Exception:  # the table is full
            time.sleep(0.1)
"""
# Ahead of all of T2, on the CPU of bridge and safety.
TAKEN_S = 0.9
TAKE_CPU = """
import os, sys, time
os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(99))
print(time.clock_gettime_ns(time.CLOCK_BOOTTIME), flush=True)
end_s = time.monotonic() + float(sys.argv[1])
while time.monotonic() < end_s:
    pass
"""
# Control characters are escaped before they are shown, which makes them longer still.
EVENTS = """
import sys, time, msgpack
from verification.faults.independent_client import ROOT, session
event = {"name": "long", "level": "info", "text": chr(27) * 4000, "boot": 1}
with session(sys.argv[1]) as bus:
    for seq in range(1, 1_000_000):
        bus.put(f"{ROOT}/evt/dashboard", msgpack.packb(event | {"seq": seq}))
        time.sleep(0.01)
"""


def injector(
    function: Callable[Concatenate[StackFixture, P], R],
) -> Callable[P, Callable[[StackFixture], R]]:
    """Return a function of all arguments but the fixture; it returns the injector."""

    @wraps(function)
    def bind(*args: P.args, **kwargs: P.kwargs) -> Callable[[StackFixture], R]:
        return lambda fixture: function(fixture, *args, **kwargs)

    return bind


@injector
def steps(fixture: StackFixture, *injectors: Injector) -> int | None:
    """Inject several faults in sequence; the last one that has a time gives it."""
    times = [inject(fixture) for inject in injectors]
    return next((at_ns for at_ns in reversed(times) if at_ns is not None), None)


# Of the driver: its speed, faults of its network.
request = injector(StackFixture.request)
network = injector(StackFixture.disturb_network)


@injector
def pause(_: StackFixture, seconds: float) -> None:
    """Wait between two steps."""
    time.sleep(seconds)


@injector
def meanwhile(fixture: StackFixture, seconds: float, inject: Injector) -> int | None:
    """Wait for some seconds; inject a fault at a random moment of them."""
    before_s = random.uniform(0.0, seconds)
    time.sleep(before_s)
    at_ns = inject(fixture)
    time.sleep(seconds - before_s)
    return at_ns


# --- processes ------------------------------------------------------------------------------------


def pid_of(fixture: StackFixture, name: str) -> int:
    """Return the pid of a process of the stack; ``guard`` is the parent of the bridge."""
    pid = fixture.running.processes["bridge" if name == "guard" else name].pid
    if name == "bridge":
        return wait_until(lambda: children(pid), "a bridge", 5.0)[0]
    return pid


@injector
def kill(fixture: StackFixture, name: str, number: signal.Signals = signal.SIGKILL) -> int:
    """Send a signal to a process of the stack; measure how long the kernel takes to end it.

    The kernel frees the memory before it closes the pipes, by which other processes notice.
    """
    process = os.pidfd_open(pid_of(fixture, name))
    at_ns = clock.now_ns()
    signal.pidfd_send_signal(process, number)
    if number == signal.SIGKILL:
        select.select([process], [], [], DEATH_S)
        fixture.death_s = (clock.now_ns() - at_ns) / NS_PER_S
    os.close(process)
    return at_ns


def restart(fixture: StackFixture) -> None:
    """Restart the processes that have ended."""
    fixture.restart_ended()


def flood(fixture: StackFixture) -> None:
    """Send 20 000 datagrams a second to the bridge's first port, from a foreign address."""
    _start(fixture, FLOOD, str(fixture.running.config.board.listen_ports[0]))


def take_cpu(fixture: StackFixture) -> int:
    """Take the CPU of bridge and safety for ``TAKEN_S``."""
    command = [sys.executable, "-c", TAKE_CPU, str(TAKEN_S)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE)
    fixture.running.others.append(process)
    assert process.stdout is not None
    return int(process.stdout.readline())


def query_flood(fixture: StackFixture) -> None:
    """Query the schemas of all services, 80 queries at once, as often as they are answered."""
    _start(fixture, QUERIES, operators_endpoint(fixture.running.config))


def request_flood(fixture: StackFixture) -> None:
    """Publish requests of one known and many unknown sources, and garbage, 3,000 a second."""
    _start(fixture, REQUESTS, operators_endpoint(fixture.running.config))


def session_flood(fixture: StackFixture) -> None:
    """Open sessions with the router until it refuses more, and hold them."""
    _start(fixture, SESSIONS, operators_endpoint(fixture.running.config))


def _start(fixture: StackFixture, program: str, word: str) -> None:
    with fixture.running.log.open("ab") as log:
        process = subprocess.Popen([sys.executable, "-c", program, word], stdout=log, stderr=log)
    fixture.running.others.append(process)


# --- the board ------------------------------------------------------------------------------------


@injector
def do(fixture: StackFixture, request: Asked) -> None:
    """Send a request to the simulated vehicle."""
    fixture.running.control.do(request)


def press(fixture: StackFixture) -> int:
    """Press the bumper; the fault time is the first frame that reports it."""
    fixture.frames.hits.clear()
    fixture.running.control.do(Bumper(pressed=True))
    becomes_true(lambda: fixture.frames.follow().hits, 2.0)
    return fixture.frames.hits[0].mono_ns


def hit(held_s: float) -> Injector:
    """Press the bumper for some time."""
    return steps(press, pause(held_s), do(Bumper(pressed=False)))


@injector
def board_line(fixture: StackFixture, line: bytes) -> int:
    """Send a line to the independent board."""
    at_ns = clock.now_ns()
    fixture.send_line(line, "sim")
    return at_ns


# --- networks, clocks, disk, the PC ---------------------------------------------------------------


@injector
def step_time_of_day(fixture: StackFixture, whose: str, seconds: int) -> None:
    """Step the time of day of one of the ``CLOCKS``."""
    step_clock(fixture.folder / whose, seconds)


def fill_disk(fixture: StackFixture) -> int | None:
    """Press the bumper, which has to be logged, while the disk of the log is full."""
    ballast = fixture.running.log.with_name("ballast")
    with ballast.open("wb", buffering=0) as file, contextlib.suppress(OSError):
        while True:
            file.write(FULL)
    at_ns = hit(0.3)(fixture)
    ballast.unlink()
    return at_ns


def kill_pc(fixture: StackFixture) -> int:
    """Kill all processes of the PC behind a relay; none reacts to the end of another."""
    processes = fixture.running.processes
    # Parents first: a guard must not see its bridge stop.
    pids = [process.pid for name, process in processes.items() if name not in NOT_ON_THE_PC]
    pids += [child for parent in pids for child in children(parent)]
    at_ns = clock.now_ns()
    for number in (signal.SIGSTOP, signal.SIGKILL):
        for pid in pids:
            os.kill(pid, number)
    return at_ns


@injector
def cable_to_pc(_: StackFixture, state: Literal["up", "down"]) -> None:
    """Cut or connect the cable between the relay and the PC."""
    ip("link", "set", "cable-pc", state)


# --- the operator ---------------------------------------------------------------------------------


@injector
def late_calls(fixture: StackFixture, name: str, request_of: Callable[[Client], Map]) -> None:
    """Make 20 calls that the operator made when the contact was latched, too late."""
    client = fixture.client
    becomes_true(lambda: client.latched, 2.0)
    payload = msgpack.packb(request_of(client))
    time.sleep(LATE_S)
    for _ in range(20):
        client.bus.get(f"{ROOT}/srv/{name}", payload=payload, timeout=1.0)
        time.sleep(0.02)


@injector
def late_releases(fixture: StackFixture) -> None:
    """Request zero and 20 times a release, as an operator did when the contact was latched."""
    client = fixture.client
    becomes_true(lambda: client.latched, 2.0)
    kill("driver")(fixture)  # its requests go before those of the dashboard's source
    drive = {"linear": 0.0, "angular": 0.0, "echo": client.state["heartbeat"], "boot": 77}
    time.sleep(LATE_S)
    for seq in range(1, 22):
        drive |= {"seq": seq, "release": "backward" if seq > 1 else "none"}
        client.bus.put(f"{ROOT}/@cmd/drive/web", msgpack.packb(drive))
        time.sleep(0.02)


def browser_estop(fixture: StackFixture) -> int:
    """Press E-STOP in the browser while clients flood the dashboard with messages and events."""
    _start(fixture, EVENTS, operators_endpoint(fixture.running.config))
    with dashboard(fixture.running.endpoint, fixture.folder) as server, flooded(server):
        time.sleep(SETTLE_S)
        pressed = urllib.request.Request(
            f"{server.url}estop/001", method="POST", headers={"Origin": server.url.rstrip("/")}
        )
        at_ns = clock.now_ns()
        with urllib.request.urlopen(pressed, timeout=10):
            time.sleep(0.1)
    return at_ns


# --- the bus, by a session that knows nothing of T2 -----------------------------------------------


@injector
def put(fixture: StackFixture, /, key: str, payload: bytes = b"", **options: Any) -> int:
    """Publish a payload once."""
    at_ns = clock.now_ns()
    fixture.client.bus.put(key, payload, **options)
    return at_ns


ESTOP = keys.estop_key("001")
# As the T2 tools do.
estop = put(ESTOP, priority=zenoh.Priority.REAL_TIME, express=True)


@injector
def repeated_estop(fixture: StackFixture, seconds: float) -> None:
    """Publish it 20 times a second, as the senders do until it is confirmed; it has to latch."""
    for _ in range(round(20 * seconds)):
        estop(fixture)
        time.sleep(0.05)
    wait_until(lambda: "estop" in fixture.client.latched, "the emergency stop")


@injector
def publish(fixture: StackFixture, payload: bytes) -> None:
    """Publish a payload once on every subscribed key except the E-STOP key, and with every call."""
    names = {"source": "teleop", "service": "safety", "side": "left", "camera": "front"}
    bus = fixture.client.bus
    for topic in keys.TOPICS:
        bus.put(
            topic.on("001", **names), payload, encoding="application/msgpack",
            congestion_control=zenoh.CongestionControl.BLOCK,
        )  # fmt: skip
    for call in keys.CALLS:
        bus.get(call.on("001"), payload=payload, timeout=0.2)
    time.sleep(0.2)


RUN = {"command": "run", "linear": 0.5, "angular": 0.0, "echo": 0, "seq": 1, "boot": 1}
HOSTILE = {
    "no MessagePack": publish(b"\xc1" * 20),
    "1 MB": publish(msgpack.packb({"text": "x" * 1_000_000})),
    "deep nesting": publish(b"\x81\xa1x" + b"\x91" * 100_000),
    "NaN": publish(msgpack.packb(RUN | {"linear": float("nan"), "angular": float("nan")})),
    "too fast": publish(msgpack.packb(RUN | {"linear": 50.0, "seq": 2**62})),
}


@injector
def forged(fixture: StackFixture, /, key: str, **fields: object) -> int:
    """Publish forgeries of a key's newest message, at 50 Hz for ``FORGED_S``."""
    client = Client(fixture.client.bus, key)
    message = wait_until(lambda: client.last(key), f"a message of {key}")
    at_ns = clock.now_ns()
    while clock.now_ns() - at_ns < FORGED_S * NS_PER_S:
        message |= {"seq": message["seq"] + AHEAD, **fields}
        client.put(key, msgpack.packb(message))
        time.sleep(0.02)
    return at_ns


def flood_of_another_robot(fixture: StackFixture) -> None:
    """Publish another robot's velocities for 1 s, 40 times as often as a robot does."""
    key = f"t2/v1/002/{VELOCITY}"
    payload = msgpack.packb({"linear": 0.5, "angular": 0.0, "seq": 1, "boot": 1})
    with session(operators_endpoint(fixture.running.config)) as robot:
        reader = fixture.client.bus.declare_subscriber(key, lambda _: None)
        time.sleep(0.1)  # until the router knows the subscriber
        for _ in range(100):
            for _ in range(20):
                robot.put(key, payload)
            time.sleep(0.01)
        reader.undeclare()
