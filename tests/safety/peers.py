"""Safety as a process, with a bridge and a driver made of publishers."""

import contextlib
import subprocess
import sys
from collections.abc import Iterator, Mapping
from typing import TypeVar

from msgspec import Struct

from common import keys
from common.bus.bus import Arrival, Bus
from common.bus.drive import DriveLink
from common.bus.publisher import Publisher
from common.client import reset_request
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
from tests.safety.policy_fixture import FREE, NO_ECHO, link
from verification.harness.waiting import wait_until

Q = TypeVar("Q", bound=Struct)

R = TypeVar("R", bound=Struct)

# Other processes may starve these; how old samples may be is not what is tested here.
PATIENT = {"stall": 1.0}


class StarvedError(Exception):
    """The machine was too busy for the scenario to mean anything."""


class Peers:
    """Plays the bridge at 50 Hz, and a source with a settable request."""

    def __init__(self, loop: Loop) -> None:
        self.loop = loop
        self.pressed = False
        self.asking: float | None = None
        self.release: ReleaseRequest = "none"
        self.state: SafetyState | None = None
        self.motion: Motion | None = None
        self.events: list[str] = []
        self.answers: list[str] = []
        self.bumper: Publisher[Bumper] | None = None

    def declare(self, bus: Bus) -> None:
        self.bus = bus
        link_to_safety = DriveLink(bus, listens=True)
        velocity = link_to_safety.publisher(keys.VELOCITY)
        ultrasonic = link_to_safety.publisher(keys.ULTRASONIC)
        bumper = self.bumper = link_to_safety.publisher(keys.BUMPER)
        sides = [link_to_safety.publisher(keys.DRIVER, side=side) for side in ("left", "right")]
        switches = link_to_safety.publisher(keys.SWITCHES)
        way = link_to_safety.publisher(keys.LINK)
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
                drive.put(
                    Drive(
                        linear=self.asking,
                        angular=0.0,
                        release=self.release,
                        echo=self.state.heartbeat,
                    )
                )

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
        self.bus.call(
            call,
            request,
            lambda _: self.answers.append("done"),
            self.answers.append,
        )
        wait_until(lambda: len(self.answers) > seen, "an answer")
        return self.answers[-1]

    def reset(self) -> ResetRequest:
        """Return an operator's reset request for the newest state."""
        assert self.state is not None
        return reset_request(self.state)

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
        """Return whether safety lost a session, as happens when no core is free for a second."""
        return "estop_reader" in self.events


@contextlib.contextmanager
def safety_process(
    endpoint: str, patient: Mapping[str, float] = PATIENT
) -> Iterator[subprocess.Popen[bytes]]:
    sets = [f"bus.connect={endpoint}", f"safety.unsafe_overrides={','.join(patient)}"]
    sets += [f"safety.{name}={value}" for name, value in patient.items()]
    options = [word for text in sets for word in ("--set", text)]
    command = [sys.executable, "-m", "services.safety", *options]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        try:
            yield process
        finally:
            process.kill()
