"""The bridge's parent process: sends BRAKE whenever the bridge does not work.

It opens the sockets to the board, so that source port and receive queue survive a restart, starts
the bridge as its child and reads its pulse. Without a pulse it sends BRAKE at 20 Hz through
the socket that the bridge used:

============== =============================== ==============================================
phase          BRAKE                           ends with
============== =============================== ==============================================
starting       until the first pulse, that a pulse: alive; none in 10 s of its CPU time
               follows the bridge's first BRAKE or of its sleep (``Start``): killed
alive          from 200 ms without one         five BRAKEs without one: killed; the pipe's end
ending, killed until the child has exited      exit: restarted, the first time at once
not started    until it could be started       started; retried after 0 to 5 s (no memory)
============== =============================== ==============================================

SIGTERM, SIGINT and SIGHUP are passed on; a bridge that stops the vehicle sends its last frame
itself. A signal after the parent has died means that the supervisor was killed: the system sends it
then (see ``cli.run.supervisor``), and the bridge brakes at once instead of coasting.

The bridge inherits the sockets and the write end of a pipe. A byte on the pipe is a pulse of
the bridge's event loop; its value is the index of the port that commands leave from, and whether
the bridge holds BRAKE (``BRAKES``). The next bridge then holds it, too. End of file means that the
bridge exits or has died.
"""

import os
import select
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from types import FrameType

from common import child_process, clock
from common.child_process import Backoff
from common.cli_args import NO_RESTART
from common.log import Logger
from common.systemd import Systemd
from common.wire import framing
from common.wire.commands import MotionCommand, MotionKind
from services.bridge.config import BridgeConfig
from services.bridge.udp import BRAKE_ATTEMPTS, Sockets

BRAKE_MS = 50
HANG_BRAKES_MAX = 5  # BRAKEs without a pulse, until the bridge is killed
START_S = 10.0  # of CPU time and of sleep, until a starting bridge is killed
EXIT_BRAKES_MAX = 20  # BRAKEs after the bridge closed its pipe, until it is killed
NOT_STARTED = 1  # exit code when the bridge could not be started
STOP_TIMEOUT_S = 4.0  # for a bridge that stops the vehicle
# Environment variable: the descriptors of the sockets, in the order of ``board.listen_ports``, and
# of the write end of the pipe.
DESCRIPTORS_ENV = "T2_BRIDGE_DESCRIPTORS"
BRAKES_ENV = "T2_BRIDGE_BRAKES"  # "1" when the bridge before held BRAKE
BRAKES = 0x80  # in a pulse: BRAKE is held until safety or an operator ends it


class Pulse:
    """The bridge's end of the pipe."""

    def __init__(self, descriptor: int, on_gone: Callable[[], None]) -> None:
        self._descriptor: int | None = descriptor
        self._on_gone = on_gone
        os.set_blocking(descriptor, False)

    def beat(self, port: int, *, brakes: bool = False) -> None:
        """Send a pulse; ``on_gone`` is called once when the guard has died."""
        if self._descriptor is None:
            return
        try:
            with suppress(BlockingIOError):  # the pipe is full: the guard has pulses to read
                os.write(self._descriptor, bytes((port | BRAKES * brakes,)))
        except OSError:
            self.end()
            self._on_gone()

    def end(self) -> None:
        """Close the pipe: no frame follows."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


class Start:
    """The time that a starting bridge has used: its CPU time and its sleep.

    While it waits for the CPU or the disk of a busy host no time counts: killed, it would begin
    again. Where the system does not report it, each period counts.
    """

    TICK_S = 1 / os.sysconf("SC_CLK_TCK")
    WAITS = b"RD"  # states of a process that is ready to run, or reads the disk

    def __init__(self, pid: int) -> None:
        self.used_s = 0.0
        self._stat = Path(f"/proc/{pid}/stat")
        self._cpu_s = 0.0

    def add(self, period_s: float) -> None:
        """Add a period without a pulse."""
        state, cpu_s = self._read()
        if cpu_s > self._cpu_s:
            self.used_s += cpu_s - self._cpu_s
        elif state not in self.WAITS:
            self.used_s += period_s
        self._cpu_s = cpu_s

    def _read(self) -> tuple[bytes, float]:
        """Return the state of the process and its CPU time."""
        try:
            _, _, fields = self._stat.read_bytes().rpartition(b") ")  # after its name
        except OSError:
            return b"?", 0.0
        state, *numbers = fields.split()
        return state, sum(map(int, numbers[10:12])) * self.TICK_S


class Guard:
    """Starts and watches the bridge process."""

    def __init__(self, config: BridgeConfig, sockets: Sockets, command: Sequence[str]) -> None:
        self._sockets = sockets
        self._command = command
        self._missed_ms = round(config.times.pulse * 1000)
        self._brake = framing.pack(MotionCommand(MotionKind.BREAK))
        self._port = 0  # index of the port that the bridge uses
        self._brakes = False  # whether the bridge holds BRAKE
        self._stopping = False
        self._parent = os.getppid()  # the supervisor
        self._child: subprocess.Popen[bytes] | None = None  # receives the signals
        self._backoff = Backoff()
        self._log = Logger()
        self._systemd = Systemd()

    def run(self) -> int:
        """Keep a bridge running until a signal or a permanent error; return the exit code."""
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._stop)
        code = 0
        while not self._stopping and code not in NO_RESTART:
            self.brake()
            started_s = time.monotonic()
            code = self._run_bridge()
            self._await_restart(code, time.monotonic() - started_s)
        return code

    def brake(self) -> None:
        """Send BRAKE as the bridge does, and report to the watchdog."""
        self._systemd.beat(clock.now_ns())
        self._sockets.send(self._brake, self._port, BRAKE_ATTEMPTS)

    def _run_bridge(self) -> int:
        """Start a bridge, watch it until it exits, and return its exit code as a shell does."""
        try:
            child, pulse = self._start()
        except (OSError, MemoryError, subprocess.SubprocessError) as error:
            self._log.error("the bridge cannot be started; sending BRAKE", error=str(error))
            return NOT_STARTED
        self._watch(child, pulse)
        os.close(pulse)
        return self._end(child)

    def _start(self) -> tuple["subprocess.Popen[bytes]", int]:
        self._child = None
        pulse, to_guard = os.pipe()
        try:
            given = (*(sock.fileno() for sock in self._sockets.sockets), to_guard)
            # Own session: ctrl-c reaches only the guard, which passes it on once; a kill of the
            # guard's session spares the bridge, which stops the vehicle.
            self._child = subprocess.Popen(
                self._command,
                env=child_process.environ() | self._state(given),
                pass_fds=given,
                start_new_session=True,
            )
        except BaseException:
            os.close(pulse)
            raise
        finally:
            os.close(to_guard)
        if self._stopping:  # signal during the start
            self._child.terminate()
        return self._child, pulse

    def _state(self, descriptors: Sequence[int]) -> dict[str, str]:
        """Return the variables that a bridge begins with."""
        brakes = "1" if self._brakes else ""
        return {DESCRIPTORS_ENV: ",".join(map(str, descriptors)), BRAKES_ENV: brakes}

    def _watch(self, child: "subprocess.Popen[bytes]", pulse: int) -> None:
        """Read pulses and brake while they are missing; return when the pipe is closed."""
        poll = select.poll()
        poll.register(pulse, select.POLLIN)
        timeout_ms, missed, alive, start = BRAKE_MS, 0, False, Start(child.pid)
        while missed < HANG_BRAKES_MAX and start.used_s < START_S:
            if poll.poll(timeout_ms):
                pulses = os.read(pulse, 4096)
                if not pulses:
                    return
                self._port, self._brakes = pulses[-1] & ~BRAKES, bool(pulses[-1] & BRAKES)
                self._systemd.ready(clock.now_ns())
                timeout_ms, missed, alive = self._missed_ms, 0, True
            else:
                self.brake()
                timeout_ms = BRAKE_MS
                if alive:
                    missed += 1
                else:
                    start.add(BRAKE_MS / 1000)
        child.kill()
        self._log.error("the bridge hangs: killed")

    def _end(self, child: "subprocess.Popen[bytes]") -> int:
        """Brake until the child has exited; return its exit code as a shell does."""
        try:
            code = child.wait(STOP_TIMEOUT_S if self._stopping else 0.0)
        except subprocess.TimeoutExpired:
            code = self._brake_until_exit(child)
        if code != 0:
            self.brake()
        return code if code >= 0 else 128 - code

    def _brake_until_exit(self, child: "subprocess.Popen[bytes]") -> int:
        for _ in range(EXIT_BRAKES_MAX):
            self.brake()
            try:
                return child.wait(BRAKE_MS / 1000)
            except subprocess.TimeoutExpired:
                continue
        child.kill()
        return child.wait()

    def _await_restart(self, code: int, lived_s: float) -> None:
        if self._stopping and code == 0:
            self._log.info("the bridge ended", exit_code=code)
            return
        wait_s = self._backoff.after(lived_s)
        self._log.error("the bridge ended", exit_code=code, wait_s=wait_s)
        end_s = time.monotonic() + wait_s
        while not self._stopping and code not in NO_RESTART and time.monotonic() < end_s:
            self.brake()
            time.sleep(BRAKE_MS / 1000)

    def _stop(self, number: int, _: FrameType | None) -> None:
        self._stopping = True
        self._systemd.stopping()
        if self._child is None:
            return
        if os.getppid() != self._parent:
            self._child.send_signal(signal.SIGINT)  # a second signal makes it brake
        self._child.send_signal(signal.SIGTERM)
