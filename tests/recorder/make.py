"""Regenerates the reference recording: ``python -m tests.recorder.make``.

The stack drives a simulated vehicle straight ahead and around a bend; then its bumper is pressed.
The recording keeps bridge, odometry, safety, events and commands, and drops health messages.
"""

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from common import keys
from common.bus.bus import Bus
from common.loop import Loop
from common.messages import SafetyState
from common.settings import Vehicle
from common.source import DriveSource
from services.recorder.mcap_codec import Encoder
from services.recorder.reader import Reader
from services.recorder.writer import RecordingWriter
from sim.requests import Bumper
from verification.harness.bus import at, running
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import PATIENCE_S, wait_until

KEPT = Path(__file__).with_name("lap.mcap")
PATHS = ("tel/bridge/", "tel/odom/odometry", "tel/safety/state", "evt/", "@cmd/")
SPEED_MPS, TURN_RADPS = 0.5, 0.5


def main() -> int:
    """Drive, record, and keep the relevant keys."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        with running_stack(folder) as stack, recorder(stack, folder) as process:
            drive(stack)
            process.terminate()
            process.wait(PATIENCE_S)
        (path,) = (p for p in folder.glob("*.mcap") if "latch" not in p.name)
        keep(path)
    print(f"{KEPT}: {KEPT.stat().st_size} bytes")  # noqa: T201
    return 0


@contextmanager
def recorder(stack: RunningStack, folder: Path) -> Iterator["subprocess.Popen[bytes]"]:
    """Record a running stack while the context lasts."""
    where = f"bus.connect={stack.endpoint}", f"recorder.folder={folder}"
    words = [word for each in (*where, "recorder.everything=true") for word in ("--set", each)]
    with subprocess.Popen([sys.executable, "-m", "services.recorder", *words]) as process:
        try:
            yield process
        finally:
            process.terminate()


def drive(stack: RunningStack) -> None:
    """Drive straight ahead and around a bend, then press the bumper."""
    twist = [0.0, 0.0]
    with ExitStack() as closing_all:
        loop = Loop()
        bus = closing_all.enter_context(closing(Bus(at(stack.endpoint), "001", loop.post)))
        source = DriveSource(bus, "demo")

        def publish() -> None:
            source.request(twist[0], twist[1])

        states: list[SafetyState] = []
        bus.subscribe(keys.SAFETY, lambda arrival: states.append(arrival.message))
        loop.every(0.05, lambda _: publish())
        bus.open()
        closing_all.enter_context(running(loop))
        wait_until(lambda: bus.connected, "the bus")

        def until(true: Callable[[], bool], linear: float, angular: float, what: str) -> None:
            twist[:] = linear, angular
            wait_until(true, what)

        # Requests of zero, until safety has all its inputs.
        until(lambda: [s.verdict for s in states[-1:]] == ["run"], 0.0, 0.0, "safety's run")
        until(lambda: stack.speed() > 0.1, SPEED_MPS, 0.0, "the vehicle moves")
        until(lambda: stack.control.truth().x > 1.0, SPEED_MPS, 0.0, "a metre")
        until(lambda: stack.control.truth().heading > 1.0, SPEED_MPS, TURN_RADPS, "a bend")
        stack.control.do(Bumper(pressed=True))
        until(lambda: stack.speed() == 0.0, SPEED_MPS, 0.0, "it stands")


def keep(path: Path) -> None:
    """Write the relevant keys; large chunks compress better."""
    KEPT.unlink(missing_ok=True)
    with Reader(path) as reader:
        entries = [each.sample for each in reader]
    kept = RecordingWriter(KEPT, Encoder(Vehicle()), reader.about)
    for sample in entries:
        if sample.key.removeprefix(f"{keys.ROOT}/001/").startswith(PATHS):
            kept.write(sample)
    kept.close()


if __name__ == "__main__":
    sys.exit(main())
