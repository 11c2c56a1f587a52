"""Record of a lap: its steps, safety's answers, and the newest messages of the robot."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import t2
from t2.messages import Odometry, SafetyState, Ultrasonic, Velocity


@dataclass(slots=True)
class LapRecord:
    """What the display and the score show of a lap; other threads read it."""

    on_step: Callable[[str], None] = lambda _: None  # called at the start of each step
    steps: list[str] = field(default_factory=list)  # begun
    finished: bool = False
    began_s: float | None = None  # monotonic time of the first step
    answers: list[tuple[str, bool, str]] = field(default_factory=list)  # step, granted, text
    unplanned: list[str] = field(default_factory=list)  # latches that the lap does not expect
    odometry: list[Odometry] = field(default_factory=list)
    safety: SafetyState | None = None
    velocity: Velocity | None = None
    ranges: Ultrasonic | None = None

    def subscribe(self, robot: t2.Robot) -> None:
        """Keep the messages of a robot."""
        robot.odometry.on(self.odometry.append)
        robot.safety.on(lambda state: setattr(self, "safety", state))
        robot.velocity.on(lambda velocity: setattr(self, "velocity", velocity))
        robot.ultrasonic.on(lambda ranges: setattr(self, "ranges", ranges))

    def step(self, name: str) -> None:
        """Begin a step."""
        if self.began_s is None:
            self.began_s = time.monotonic()
        self.steps.append(name)
        self.on_step(name)

    def answer(self, granted: bool, text: str) -> None:
        """Keep safety's answer to a call, once."""
        known = (self.steps[-1], granted, text)
        if known not in self.answers[-1:]:
            self.answers.append(known)
