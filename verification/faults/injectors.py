"""Fault injectors for processes, the board, the environment, the operator and the bus."""

import contextlib
import os
import select
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import wraps
from typing import Any, Concatenate, Literal, ParamSpec, TypeVar

import msgpack
import msgspec
import zenoh
from msgspec.structs import replace

from common import clock, codec, keys
from common.bus.session import client_config
from common.freshness import NS_PER_S
from common.messages import Bumper as BumperSample
from common.messages import Motion, Velocity
from common.motion import Command
from common.operator import release_request, reset_request
from sim.requests import Asked, Bumper, Mute, ReportName, Wire
from verification.faults.namespaces import step_clock
from verification.faults.stack_fixture import PROGRAMS, StackFixture, operators_endpoint
from verification.harness.bus import at
from verification.harness.dashboard import Server, dashboard
from verification.harness.network_hosts import ip
from verification.harness.process_stats import children
from verification.harness.stack import SETTINGS_FILE
from verification.harness.waiting import becomes_true, wait_until

P = ParamSpec("P")
R = TypeVar("R", bound=int | None)
# Returns the time of the fault when that is not the time of its call.
Injector = Callable[[StackFixture], int | None]

LATE_S = 1.3  # a reset may be 1.0 s old, a held release 0.4 s
DEATH_S = 1.0  # longer than a kernel needs to end a process
HUNG_S = 0.05  # the vehicle still moves: the lease is 0.2 s
LOST_S = 2.0  # twice the lease of a session
FORGED_S = 0.6
AHEAD = 1000
BACKWARD_MPS = -0.5  # no driver of the campaign requests it
SETTLE_S = 1.0  # until an abuse takes effect
HELD_S, LET_GO_S = 0.3, 0.4
FULL = b"x" * 4096
NOT_ON_THE_PC = ("sim", "relay", "driver")


def injector(
    function: Callable[Concatenate[StackFixture, P], R],
) -> Callable[P, Callable[[StackFixture], R]]:
    """Return a function of all arguments but the fixture; it returns the injector."""

    @wraps(function)
    def bind(*args: P.args, **kwargs: P.kwargs) -> Callable[[StackFixture], R]:
        return lambda fixture: function(fixture, *args, **kwargs)

    return bind


# --- processes ------------------------------------------------------------------------------------


def pid_of(fixture: StackFixture, name: str) -> int:
    """Return the pid of a process of the stack.

    ``guard`` is the parent of the bridge; ``teleop`` is a child of the driver process.
    """
    parents = {"bridge": "bridge", "guard": "bridge", "teleop": "driver"}
    pid = fixture.running.processes[parents.get(name, name)].pid
    if name in ("bridge", "teleop"):
        return wait_until(lambda: children(pid), f"a child of {pid}", 5.0)[0]
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


@injector
def hung(fixture: StackFixture, name: str, seconds: float, inject: Injector) -> int | None:
    """Stop a process, and inject another fault after some time."""
    os.kill(pid_of(fixture, name), signal.SIGSTOP)
    time.sleep(seconds)
    return inject(fixture)


@injector
def second(fixture: StackFixture, name: str) -> None:
    """Start a second instance of a process of the stack."""
    _start(fixture, fixture.running.commands[name])


def second_driver(fixture: StackFixture) -> None:
    """Start a second driver under the same source name."""
    endpoint = fixture.running.endpoint
    _start(fixture, [sys.executable, "-m", PROGRAMS, endpoint, "driver"], b"0.8\n")


def flood(fixture: StackFixture) -> None:
    """Send 20 000 datagrams a second to the bridge's first port, from a foreign address."""
    address = f"127.0.0.1:{fixture.running.config.board.listen_ports[0]}"
    _start(fixture, [sys.executable, "-m", PROGRAMS, address, "flood"])


def _start(fixture: StackFixture, command: list[str], line: bytes = b"") -> None:
    with fixture.running.log.open("ab") as log:
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=log, stderr=log)
    fixture.running.others.append(process)
    assert process.stdin is not None
    process.stdin.write(line)
    process.stdin.flush()


def spoil_config(fixture: StackFixture) -> int:
    """Write an invalid settings file, kill the bridge, and restore the file after its end."""
    settings = fixture.folder / SETTINGS_FILE
    settings.write_text("[bridge]\nlease = 'endless'\n")
    at_ns = kill("bridge")(fixture)
    becomes_true(lambda: fixture.running.processes["bridge"].poll() is not None, 10.0)
    settings.write_text("")
    return at_ns


# --- the simulated board --------------------------------------------------------------------------


@injector
def do(fixture: StackFixture, *requests: Asked) -> None:
    """Send requests to the simulated vehicle."""
    for request in requests:
        fixture.running.control.do(request)


def in_sequence(*injectors: Injector) -> Injector:
    """Inject several faults in sequence; the time of the last one counts."""
    return lambda fixture: [inject(fixture) for inject in injectors][-1]


@injector
def silent(fixture: StackFixture, report: ReportName, seconds: float) -> None:
    """Suppress a report of the board for some time, then restore it."""
    fixture.running.control.do(Mute(reports=(report,)))
    time.sleep(seconds)
    fixture.running.control.do(Mute())


@injector
def hit(fixture: StackFixture, held_s: float) -> int:
    """Press the bumper; the fault time is the first frame that reports it."""
    fixture.frames.hits.clear()
    fixture.running.control.do(Bumper(pressed=True))
    becomes_true(lambda: fixture.frames.follow().hits, 2.0)
    time.sleep(held_s)
    fixture.running.control.do(Bumper(pressed=False))
    return fixture.frames.hits[0].mono_ns


# --- networks, clocks, disk, the PC ---------------------------------------------------------------


@injector
def network(fixture: StackFixture, faults: Wire) -> None:
    """Disturb the packets between the driver and the robot."""
    fixture.disturb_network(faults)


@injector
def cut_and_let_go(fixture: StackFixture, seconds: float) -> None:
    """Cut the driver's network and release the stick meanwhile; then deliver what was queued."""
    fixture.disturb_network(Wire(drop=1.0))
    time.sleep(LET_GO_S)  # the driver still requests motion
    fixture.request(0.0)
    time.sleep(seconds - LET_GO_S)
    fixture.disturb_network(Wire())


@injector
def step_time_of_day(fixture: StackFixture, whose: str, seconds: int) -> None:
    """Step the time of day of one of the ``CLOCKS``."""
    step_clock(fixture.folder / whose, seconds)


def fill_disk(fixture: StackFixture) -> int:
    """Press the bumper, which has to be logged, while the disk of the log is full."""
    ballast = fixture.running.log.with_name("ballast")
    with ballast.open("wb", buffering=0) as file, contextlib.suppress(OSError):
        while True:
            file.write(FULL)
    at_ns = hit(HELD_S)(fixture)
    ballast.unlink()
    return at_ns


@injector
def signal_pc(fixture: StackFixture, *numbers: signal.Signals) -> int:
    """Send signals to all processes of the PC behind a relay."""
    processes = fixture.running.processes
    # Parents first: a guard must not see its bridge stop.
    pids = [process.pid for name, process in processes.items() if name not in NOT_ON_THE_PC]
    pids += [child for parent in pids for child in children(parent)]
    at_ns = clock.now_ns()
    for number in numbers:
        for pid in pids:
            os.kill(pid, number)
    return at_ns


stop_pc = signal_pc(signal.SIGSTOP)  # as when its kernel hangs
kill_pc = signal_pc(signal.SIGSTOP, signal.SIGKILL)  # stopped first: none reacts to another's end


@injector
def cut_cable(_: StackFixture, side: Literal["pc", "board"], seconds: float) -> None:
    """Cut one of the relay's two cables for some time."""
    ip("link", "set", f"cable-{side}", "down")
    time.sleep(seconds)
    ip("link", "set", f"cable-{side}", "up")


@injector
def restart_relay(fixture: StackFixture, after_s: float) -> int:
    """Kill the relay, and start it again as a supervisor does."""
    at_ns = fixture.running.kill("relay")
    time.sleep(after_s)
    fixture.running.start("relay")
    return at_ns


# --- the operator ---------------------------------------------------------------------------------


def estop(fixture: StackFixture) -> int:
    """Publish an E-STOP as the T2 tools do."""
    at_ns = clock.now_ns()
    fixture.bus.estop()
    return at_ns


def late_resets(fixture: StackFixture) -> int:
    """Press the bumper; 20 reset calls that the operator made then arrive too late."""
    at_ns = hit(0.1)(fixture)
    becomes_true(fixture.latched, 2.0)
    assert fixture.state is not None
    fixture.request(0.0)  # safety refuses a reset while motion is requested
    _call_late(fixture, keys.RESET, reset_request(fixture.state))
    return at_ns


def late_releases(fixture: StackFixture) -> int:
    """Keep the bumper pressed; 20 calls of a held release arrive too late."""
    fixture.frames.hits.clear()
    fixture.running.control.do(Bumper(pressed=True))
    becomes_true(lambda: fixture.frames.follow().hits and fixture.latched(), 2.0)
    _call_late(fixture, keys.RELEASE, release_request(fixture.state, "backward", held=True))
    fixture.running.control.do(Bumper(pressed=False))
    return fixture.frames.hits[0].mono_ns


def _call_late(fixture: StackFixture, call: keys.Call[Any, Any], request: msgspec.Struct) -> None:
    time.sleep(LATE_S)
    for _ in range(20):
        fixture.bus.call(call, request, _ignore, _ignore, 1.0)
        time.sleep(0.02)


def _ignore(_: object) -> None:
    """Ignore an answer; the frames at the board decide."""


@injector
def stall_terminal(fixture: StackFixture, seconds: float, held_s: float = 0.3) -> None:
    """Stall the operator's terminal; the key is released meanwhile, its repeats arrive later."""
    fixture.send_line(b"stall %f" % seconds)
    time.sleep(held_s)
    fixture.request(0.0)


@injector
def browser_estop(
    fixture: StackFixture, abuse: Callable[[Server], AbstractContextManager[Any]]
) -> int:
    """Press E-STOP in the browser while another client abuses the dashboard."""
    with contextlib.ExitStack() as stack:
        server = stack.enter_context(dashboard(fixture.running.endpoint, fixture.folder))
        stack.enter_context(abuse(server))
        time.sleep(SETTLE_S)
        request = urllib.request.Request(
            f"{server.url}estop/001", method="POST", headers={"Origin": server.url.rstrip("/")}
        )
        at_ns = clock.now_ns()
        with urllib.request.urlopen(request, timeout=10):
            time.sleep(0.1)
    return at_ns


# --- the bus --------------------------------------------------------------------------------------


def plain_client(fixture: StackFixture) -> zenoh.Session:
    """Return a session with the operators' router that knows nothing of T2."""
    return zenoh.open(client_config(at(operators_endpoint(fixture.running.config))))


@injector
def estop_by(fixture: StackFixture, put: Callable[[zenoh.Session, str], None]) -> int:
    """Publish an E-STOP as a program does that knows only the key."""
    with plain_client(fixture) as session:
        time.sleep(0.1)  # until the router knows the session
        at_ns = clock.now_ns()
        put(session, keys.estop_key("001"))
        time.sleep(0.1)
    return at_ns


@injector
def publish(fixture: StackFixture, payload: bytes, encoding: str = "application/msgpack") -> None:
    """Publish a payload once on every subscribed key except the E-STOP key, and with every call."""
    names = {"source": "teleop", "service": "safety", "side": "left"}
    with plain_client(fixture) as session:
        for topic in keys.TOPICS:
            session.put(
                topic.on("001", **names), payload, encoding=encoding,
                congestion_control=zenoh.CongestionControl.BLOCK,
            )  # fmt: skip
        for call in keys.CALLS:
            session.get(call.on("001"), payload=payload, timeout=0.2)
        time.sleep(0.2)


MOTION = {"command": "run", "linear": 0.5, "angular": 0.0, "echo": 0, "seq": 1, "boot": 1}


def motion(**fields: float) -> Injector:
    """Publish a motion with unusual numbers on every key."""
    return publish(msgpack.packb(MOTION | fields))


HOSTILE = {
    "no MessagePack": publish(b"\xc1" * 20),
    "nothing": publish(b""),
    "1 MB": publish(msgpack.packb({"text": "x" * 1_000_000})),
    "deep nesting": publish(b"\x81\xa1x" + b"\x91" * 100_000),
    "wrong types": publish(msgpack.packb({name: [] for name in MOTION})),
    "NaN": motion(linear=float("nan"), angular=float("nan")),
    "infinity": motion(linear=float("inf")),
    "negative zero": motion(linear=-0.0, angular=-0.0),
    "huge integers": motion(linear=2**63, seq=2**64 - 1),
    "too fast": motion(linear=50.0, seq=2**62),
    "JSON": publish(msgspec.json.encode(MOTION), "application/json"),
    "an encoding of text": publish(msgpack.packb(MOTION), "text/plain"),
    # The longest that Zenoh can send.
    "an encoding nobody knows": publish(msgpack.packb(MOTION), "x" * 200),
}


@injector
def forged(fixture: StackFixture, make: Callable[[Motion, BumperSample], dict[str, bytes]]) -> int:
    """Publish forgeries of the newest motion and bumper sample, at 50 Hz for ``FORGED_S``."""
    newest: dict[str, bytes] = {}
    wanted = keys.MOTION.on("001"), keys.BUMPER.on("001")

    def take(sample: zenoh.Sample) -> None:
        newest[str(sample.key_expr)] = sample.payload.to_bytes()

    with plain_client(fixture) as session:
        subscribers = [session.declare_subscriber(key, take) for key in wanted]
        becomes_true(lambda: len(newest) == len(subscribers), 2.0)
        command = codec.decode(newest[wanted[0]], Motion)
        sample = codec.decode(newest[wanted[1]], BumperSample)
        at_ns = clock.now_ns()
        while clock.now_ns() - at_ns < FORGED_S * NS_PER_S:
            command = replace(command, seq=command.seq + AHEAD)
            sample = replace(sample, seq=sample.seq + AHEAD)
            for key, payload in make(command, sample).items():
                session.put(key, payload)
            time.sleep(0.02)
    return at_ns


def authority(command: Motion, _: BumperSample) -> dict[str, bytes]:
    """Forge a motion command of safety."""
    run = replace(command, command=Command.RUN, linear=BACKWARD_MPS)
    return {keys.MOTION.on("001"): codec.encode(run)}


def lock_out(command: Motion, _: BumperSample) -> dict[str, bytes]:
    """Forge a motion with a sequence number above all that safety will use."""
    return {keys.MOTION.on("001"): codec.encode(replace(command, seq=2**62))}


def measurements(_: Motion, bumper: BumperSample) -> dict[str, bytes]:
    """Forge a contact and a runaway velocity of the bridge."""
    velocity = Velocity(linear=3.0, angular=0.0, seq=bumper.seq, boot=bumper.boot)
    return {
        keys.BUMPER.on("001"): codec.encode(replace(bumper, pressed=True)),
        keys.VELOCITY.on("001"): codec.encode(velocity),
    }


def flood_of_another_robot(fixture: StackFixture) -> None:
    """Publish another robot's velocities for 1 s, 40 times as often as a robot does."""
    key = keys.VELOCITY.on("002")
    payload = codec.encode(Velocity(linear=0.5, angular=0.0, seq=1, boot=1))
    with plain_client(fixture) as reader, plain_client(fixture) as robot:
        reader.declare_subscriber(key, _ignore)
        time.sleep(0.1)  # until the router knows the subscriber
        for _ in range(100):
            for _ in range(20):
                robot.put(key, payload)
            time.sleep(0.01)
