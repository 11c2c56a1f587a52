"""The whole stack as processes, with a simulator that writes a trace."""

import contextlib
import signal
import socket
import subprocess
import sys
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from cli.demo import host_stalls
from cli.demo.score import Trace, read
from cli.run.up import camera, commands
from cli.settings import Everything
from common import clock
from common.cli_args import source_words
from common.config import Sources, load
from sim.requests import Asked, GetTruth
from sim.simulation import Reply
from sim.sockets import HOST, LARGEST
from sim.trace import Truth
from t2.errors import LinkError, MessageError
from verification.harness.bus import set_options
from verification.harness.ports import free_port, udp_ports
from verification.harness.waiting import wait_until

STALL_S = 0.3  # of a busy host, which a test whose subject is not time must bear
UP_S = 60.0  # on a shared host
SETTINGS_FILE = "stack.toml"  # read by all processes when it is in the folder of the stack


class Control:
    """A client of the simulator's control socket."""

    def __init__(self, port: int, timeout_s: float = 5.0) -> None:
        self._port = port
        self._timeout_s = timeout_s

    def do(self, request: Asked) -> Reply:
        """Send a request; ``MessageError`` when it is refused, ``LinkError`` when none answers."""
        try:
            reply = msgspec.json.decode(self._exchange(msgspec.json.encode(request)), type=Reply)
        except OSError as error:  # includes timeouts
            raise LinkError(f"the simulator's control socket: {error}") from None
        if not reply.ok:
            raise MessageError(reply.error)
        return reply

    def truth(self) -> Truth:
        """Return the true state; errors as in ``do``."""
        truth = self.do(GetTruth()).truth
        assert truth is not None
        return truth

    def _exchange(self, payload: bytes) -> bytes:
        # A socket for each request: a late reply to an earlier one must not be taken for its own.
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.settimeout(self._timeout_s)
            sock.connect((HOST, self._port))
            sock.send(payload)
            return sock.recv(LARGEST)


@dataclass
class RunningStack:
    """Processes by name, and access to the simulated board."""

    endpoint: str
    trace_file: Path
    control: Control
    commands: dict[str, list[str]]
    log: Path
    config: Everything  # effective
    env: Mapping[str, str] | None = None  # of the processes; ours when None
    processes: dict[str, "subprocess.Popen[bytes]"] = field(default_factory=dict)
    others: list["subprocess.Popen[bytes]"] = field(default_factory=list)  # beside the stack

    def start(self, name: str) -> None:
        """Start a process, or start it again after its end; it reads a pipe."""
        if name in self.processes:
            self.processes[name].communicate()  # closes the pipe of the ended one
        with self.log.open("ab") as output:
            self.processes[name] = subprocess.Popen(
                self.commands[name],
                stdin=subprocess.PIPE,
                stdout=output,
                stderr=output,
                env=self.env,
            )

    def kill(self, name: str) -> int:
        """Kill a process with SIGKILL; return the time, in monotonic nanoseconds."""
        process = self.processes[name]
        at_ns = clock.now_ns()
        process.send_signal(signal.SIGKILL)
        process.wait()
        return at_ns

    def trace(self) -> Trace:
        """Return the trace so far."""
        return read(self.trace_file)

    def last(self) -> str:
        """Return the kind of the command that the board holds."""
        made = self.trace().commands
        return made[-1].kind if made else "none"

    def speed(self) -> float:
        """Return the true speed of the vehicle, in m/s."""
        return self.control.truth().linear

    def end(self) -> None:
        """Kill all processes."""
        for process in (*self.processes.values(), *self.others):
            process.kill()
            process.communicate()  # also closes its pipes


@contextlib.contextmanager
def running_stack(
    folder: Path,
    world: str = "empty",
    *,
    sets: Sequence[str] = (),
    profiles: Sequence[str] = (),
    shipped: bool = False,
    listen: str = "tcp/127.0.0.1:{port}",
    log: str = "log.jsonl",
    env: Mapping[str, str] | None = None,
    route: Callable[[Sequence[str]], list[str]] | None = None,
    board: Callable[[Everything], list[str]] | None = None,
    sim_sets: Sequence[str] = (),
    beside: Callable[[Everything], Mapping[str, list[str]]] | None = None,
    with_camera: bool = False,
) -> Iterator[RunningStack]:
    """Run the stack; on a host with scheduling stalls its time limits are relaxed.

    ``shipped`` keeps the shipped limits on any host, and ``sets``, additional settings, stay as
    they are. ``profiles`` are those of the simulated vehicle, ``sim_sets`` settings of the
    simulator alone. ``listen`` is where the router listens, the endpoint of the services first;
    ``log`` is a file in the folder. ``route`` returns the command of another router, zenohd, for
    these settings, ``board`` that of another board, without the file of the trace. ``beside``
    returns the commands of further processes, which are not waited for. ``with_camera`` adds a
    simulated camera.
    """
    control = free_port(socket.SOCK_DGRAM)
    sets = _all_settings(sets, shipped, listen, control)
    config = load(Everything, Sources(sets=sets)).config
    files = [file for file in (folder / SETTINGS_FILE,) if file.exists()]
    options = Namespace(config=files, sets=[*sets, f"sim.world={world}"])
    started = commands(source_words(options), profiles)
    started |= camera(options, config, started) if with_camera else {}
    made = {name: list(command) for name, command in started.items()}
    if route:
        made["router"] = route(sets)
    trace_file = folder / "trace.jsonl"
    made["sim"] += ["--trace", str(trace_file), *set_options(*sim_sets)]
    if board:
        made["sim"] = [*board(config), str(trace_file)]
    services = sum(command[0] == sys.executable for command in made.values())
    made |= beside(config) if beside else {}
    it = RunningStack(
        config.bus.endpoints[0], trace_file, Control(control), made, folder / log, config, env
    )
    for name in made:
        it.start(name)
    try:
        wait_until(lambda: _is_up(it, services), f"all processes up: {it.log}", UP_S)
        yield it
    finally:
        it.end()


def _all_settings(sets: Sequence[str], shipped: bool, listen: str, control: int) -> Sequence[str]:
    """Return settings with free ports, and with the lengthened limits of a busy host."""
    holdup_s = 0.0 if shipped else STALL_S
    own = {one.partition("=")[0] for one in sets if not one.startswith(host_stalls.OVERRIDES)}
    relaxed = [one for one in host_stalls.settings(holdup_s) if one.partition("=")[0] not in own]
    board, *listen_ports = udp_ports(3)
    ports = [
        f"board.port={board}",
        f"board.listen_ports={listen_ports}",
        f"bus.listen={listen.format(port=free_port())}",
        f"sim.control_port={control}",
    ]
    return host_stalls.with_overrides_joined([*sets, *ports, *relaxed])


def _is_up(it: RunningStack, services: int) -> bool:
    ended = [name for name, process in it.processes.items() if process.poll() is not None]
    assert not ended, f"{ended} ended: {it.log.read_text()}"
    return it.log.read_text().count('"event": "started"') >= services
