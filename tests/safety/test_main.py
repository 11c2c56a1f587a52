"""The real process, a real router, and a bridge and a driver made of publishers."""

import contextlib
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import TypeVar

from msgspec import Struct

from common import keys
from common.bus.bus import Arrival, Bus
from common.bus.publisher import Publisher
from common.keys import Call
from common.loop import Loop
from common.messages import (
    Bumper,
    Drive,
    Driver,
    Event,
    Motion,
    ReleaseRequest,
    ResetRequest,
    SafetyState,
    Switches,
    Ultrasonic,
    Velocity,
)
from tests.safety.scene import FREE, NO_ECHO, link
from tests.support import PATIENCE_S, bus_on, running, wait_until

Q = TypeVar("Q", bound=Struct)
R = TypeVar("R", bound=Struct)


# Other processes may starve these; how old samples may be is not what is tested here.
PATIENT = {
    "bumper_age": 8,
    "ultrasonic_age": 8,
    "velocity_age": 8,
    "link_age": 8,
    "max_echo_age": 8,
    "sources.demo.lease": 3,
}


class StarvedError(Exception):
    """The machine was too busy for the scenario to mean anything."""


class Peers:
    """Plays the bridge at 50 Hz and a driver that asks what it is told to."""

    def __init__(self, loop: Loop) -> None:
        self.loop = loop
        self.pressed = False
        self.asking: float | None = None
        self.state: SafetyState | None = None
        self.motion: Motion | None = None
        self.events: list[str] = []
        self.answers: list[str] = []
        self.bumper: Publisher[Bumper] | None = None

    def declare(self, bus: Bus) -> None:
        self.bus = bus
        velocity = bus.publisher(keys.VELOCITY)
        ultrasonic = bus.publisher(keys.ULTRASONIC)
        bumper = self.bumper = bus.publisher(keys.BUMPER)
        sides = [bus.publisher(keys.DRIVER, side=side) for side in ("left", "right")]
        switches = bus.publisher(keys.SWITCHES)
        way = bus.publisher(keys.LINK)
        drive = bus.publisher(keys.DRIVE, source="demo")
        bus.subscribe(keys.SAFETY, self.on_state)
        bus.subscribe(keys.MOTION, self.on_motion)
        bus.subscribe(keys.EVENTS, self.on_event, depth=32, service="safety")

        def play(_: int) -> None:
            velocity.put(Velocity(linear=0.0, angular=0.0))
            ultrasonic.put(Ultrasonic(ranges=FREE, status=NO_ECHO))
            bumper.put(Bumper(pressed=self.pressed))
            for side in sides:
                side.put(Driver(faults=(), bits=0))
            switches.put(Switches(ultrasonic_brake=True, bumper_brake=True))
            way.put(link())
            if self.asking is not None and self.state:
                drive.put(Drive(linear=self.asking, angular=0.0, echo=self.state.heartbeat))

        self.loop.every(0.02, play)

    def on_state(self, arrival: Arrival[SafetyState]) -> None:
        self.state = arrival.message

    def on_motion(self, arrival: Arrival[Motion]) -> None:
        self.motion = arrival.message

    def on_event(self, arrival: Arrival[Event]) -> None:
        self.events.append(arrival.message.name)

    def call(self, call: Call[Q, R], request: Q) -> str:
        """Make a call and wait for its answer."""
        seen = len(self.answers)
        self.bus.ask(
            call,
            request,
            lambda _: self.answers.append("done"),
            self.answers.append,
        )
        wait_until(lambda: len(self.answers) > seen, "an answer")
        return self.answers[-1]

    def until(self, command: str, verdict: str, moving: bool = False) -> None:
        def there() -> bool:
            m, s = self.motion, self.state
            if m is None or s is None or (m.command, s.verdict) != (command, verdict):
                return False
            return (m.linear != 0) == moving

        try:
            wait_until(lambda: there() or self.starved, f"{command}, {verdict}")
        except AssertionError as error:
            raise AssertionError(f"{error}: {self.motion}, {self.state}") from None
        if self.starved and not there():
            raise StarvedError

    @property
    def starved(self) -> bool:
        """Tell whether a session was lost, as happens when no core is free for a second."""
        return "estop_reader" in self.events


@contextlib.contextmanager
def safety_process(endpoint: str) -> Iterator[subprocess.Popen[bytes]]:
    sets = [f"bus.connect={endpoint}", f"safety.i_accept={','.join(PATIENT)}"]
    sets += [f"safety.{name}={value}" for name, value in PATIENT.items()]
    options = [word for text in sets for word in ("--set", text)]
    command = [sys.executable, "-m", "services.safety", *options]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        try:
            yield process
        finally:
            process.kill()


def test_from_inhibited_to_run_to_contact_to_reset(endpoint: str) -> None:
    for _ in range(3):
        with contextlib.suppress(StarvedError):
            scenario(endpoint)
            return
    raise AssertionError("the machine was too busy three times")


def scenario(endpoint: str) -> None:
    loop = Loop()
    peers = Peers(loop)
    with running(loop), bus_on(endpoint, loop, peers.declare), safety_process(endpoint) as process:
        peers.until("stop", "stop")  # settled; nobody asks
        peers.asking = 0.3
        peers.until("stop", "inhibited")  # not before a neutral request
        peers.asking = 0.0
        peers.until("run", "run")
        peers.asking = 0.3
        peers.until("run", "run", moving=True)

        peers.pressed = True
        peers.until("brake", "brake")
        assert peers.motion is not None
        assert peers.bumper is not None
        assert peers.bumper.last is not None
        assert peers.motion.judged_boot == peers.bumper.last.boot
        assert 0 < peers.motion.judged <= peers.bumper.last.seq
        peers.asking = None
        assert "Not gone yet" in peers.call(keys.RESET, ResetRequest())
        peers.pressed = False
        wait_until(
            lambda: peers.starved or peers.call(keys.RESET, ResetRequest()) == "done",
            "a reset that is granted",
        )
        peers.until("stop", "stop")

        peers.bus.estop()
        peers.until("brake", "brake")
        assert peers.call(keys.RELEASE, ReleaseRequest()) != "done"
        wanted = {"contact", "stop", "reset", "reset_refused", "estop", "release_refused", "source"}
        wait_until(lambda: wanted <= set(peers.events), f"{wanted - set(peers.events)}")

        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE_S) == 0


def test_a_setting_that_takes_a_protection_away_ends_the_program() -> None:
    command = [sys.executable, "-m", "services.safety", "--set", "safety.margin=0"]
    done = subprocess.run(command, capture_output=True, check=False, timeout=PATIENCE_S)
    assert done.returncode == 78
    assert b"margin" in done.stderr
    assert b"i_accept" in done.stderr
