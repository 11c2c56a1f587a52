"""The simulated vehicle as a process: sockets, clock and trace around the simulation."""

from contextlib import ExitStack, closing
from pathlib import Path

import msgspec

from common import clock
from common.errors import ConfigError
from common.freshness import NS_PER_S
from common.log import Logger
from common.loop import Loop
from sim import trace as t
from sim.config import Config
from sim.model import Model
from sim.simulation import STEP_NS, Simulation
from sim.sockets import BoardSocket, ControlSocket
from sim.world import Plan


class Trace:
    """A file of JSON lines, unbuffered; or none."""

    def __init__(self, file: Path | None) -> None:
        try:
            self._out = file.open("wb", buffering=0) if file else None
        except OSError as error:
            raise ConfigError(f"--trace {file}: cannot be written: {error.strerror}") from None

    def write(self, line: t.Line) -> None:
        """Append a line."""
        if self._out is not None:
            self._out.write(msgspec.json.encode(line) + b"\n")

    def close(self) -> None:
        """Close the file."""
        if self._out is not None:
            self._out.close()


class Process:
    """The whole of ``python -m sim``; the constructor opens the sockets."""

    def __init__(self, config: Config, model: Model, plan: Plan, trace: Trace) -> None:
        ports = config.board.listen_ports
        self.simulation = Simulation(model, plan, clock.now_ns(), config.sim.seed, ports)
        self._trace = trace
        self._log = Logger()
        with ExitStack() as stack:  # closes opened sockets when a later port is taken
            self.loop = stack.enter_context(closing(Loop()))
            self._board = stack.enter_context(closing(BoardSocket(config.board)))
            self.loop.watch(self._board.sock, self._receive)
            if config.sim.control_port:
                control = ControlSocket(config.sim.control_port, self.simulation)
                stack.enter_context(closing(control))
                self.loop.watch(control.sock, lambda now_ns: self._serve_control(control, now_ns))
            self._opened = stack.pop_all()
        self.loop.every(STEP_NS / NS_PER_S, self._step)

    def run(self) -> None:
        """Run until the loop is stopped."""
        self.loop.run()
        counters = dict(self.simulation.counters)
        self._log.info("stopped", unsent=self._board.unsent, **counters)

    def close(self) -> None:
        """Close ports and descriptors."""
        self._opened.close()

    def _step(self, now_ns: int) -> None:
        self.simulation.advance(now_ns)
        self._deliver()

    def _receive(self, now_ns: int) -> None:
        # Advance first, so that answers are current even after a stall of this process.
        self.simulation.advance(now_ns)
        for payload, port in self._board.receive():
            self.simulation.receive(payload, port, now_ns)
        self._deliver()

    def _serve_control(self, control: ControlSocket, now_ns: int) -> None:
        control.serve(now_ns)
        self._deliver()

    def _deliver(self) -> None:
        now_ns = clock.now_ns()
        for datagram in self.simulation.take_sent(now_ns):
            self._board.send(datagram)
        for line in self.simulation.take_records():
            self._trace.write(line)
            self._log_line(line)

    def _log_line(self, line: t.Line) -> None:
        match line:
            case t.BumperSent():
                self._log.info("bumper reported", pressed=line.pressed)
            case t.Power():
                self._log.warning("power", on=line.on)
            case t.Disturbed():
                request = msgspec.to_builtins(line.request)
                self._log.warning("disturbed", request=request, error=line.error)
            case _:  # commands and truth are samples, not transitions
                pass
