"""The checkout on the bus: waits until something is so, asks, and drives while it waits.

Everything happens in one thread. The loop turns only while something is waited for; while the
operator is asked a question it stands, and so does the vehicle: silence is a release.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import msgspec
from msgspec import Struct

from cli.commission.message_log import Tape
from cli.commission.motion import too_fast
from common.bus.bus import Bus
from common.errors import LinkError
from common.freshness import NS_PER_S
from common.keys import Call
from common.loop import Loop
from common.motion import STILL, Twist, is_standing
from common.settings import Shared
from common.source import DriveSource

SOURCE = "checkout"  # as safety's settings name it
ASK_S, LOOK_S = 0.05, 0.02
ROUTER_S = 10.0
READY_S = 8.0  # to be let through by safety; a cause that clears by itself needs half a second
REST_S = 3.0  # to stand after the release
ZEROS_S = 0.15  # three of them

Settings = dict[str, Any]


class Bench:
    """One run of the checkout on a bus."""

    def __init__(self, config: Shared) -> None:
        self.loop = Loop()
        self.bus = Bus(config.bus, config.robot.id, self.loop.post)
        self.tape = Tape(self.bus)
        self._endpoints = ", ".join(config.bus.endpoints)
        self._source = DriveSource(self.bus, SOURCE)
        self._wish: Twist | None = None
        self._done: Callable[[], object] = lambda: True
        self.loop.every(ASK_S, self._ask)
        self.loop.every(LOOK_S, self._look)

    @contextmanager
    def opened(self) -> "Iterator[Bench]":
        """Keep the session open while the context lasts; raise ``LinkError`` without a stack."""
        self.bus.open()
        try:
            if not self.until(lambda: self.tape.links and self.tape.safety, ROUTER_S):
                raise LinkError(
                    f"no bridge and no safety service are heard on {self._endpoints}; "
                    "start `t2 up --no-sim --config config/vehicle.toml` first"
                )
            yield self
        finally:
            self.bus.close()
            self.loop.close()

    def until(self, true: Callable[[], object], patience_s: float) -> bool:
        """Turn the loop until it is true, at most so long; return whether it is."""
        end_ns = time.monotonic_ns() + round(patience_s * NS_PER_S)
        self._done = lambda: true() or time.monotonic_ns() > end_ns
        self.loop.run()
        return bool(true())

    def listen(self, seconds: float) -> None:
        """Turn the loop for so long."""
        self.until(lambda: False, seconds)

    def call(self, call: Call[Any, Any], request: Struct) -> tuple[bool, str]:
        """Make a call; return whether it was carried out, and the words."""
        answers: list[tuple[bool, str]] = []
        self.bus.ask(
            call,
            request,
            lambda done: answers.append((True, done.text)),
            lambda reason: answers.append((False, reason)),
        )
        self.until(lambda: answers, ROUTER_S)
        return answers[0] if answers else (False, "there was no answer")

    def settings(self, service: str) -> dict[str, tuple[Any, str]]:
        """Return a service's settings with their origin, by path; raise ``LinkError``."""
        answers: list[bytes] = []
        refusals: list[str] = []
        self.bus.look_up(service, "config", answers.append, refusals.append)
        self.until(lambda: answers or refusals, ROUTER_S)
        if not answers:
            reason = refusals[0] if refusals else "there was no answer"
            raise LinkError(f"the settings of {service} cannot be had: {reason}")
        told = msgspec.json.decode(answers[0], type=dict[str, dict[str, Any]])
        return {path: (one["value"], str(one["origin"])) for path, one in told.items()}

    def latched(self) -> tuple[str, ...]:
        """Return what safety said last that it has latched."""
        return self.tape.safety[-1].value.latched if self.tape.safety else ()

    def drive(self, asked: Twist, seconds: float) -> int | None:
        """Ask for a motion, then for zero until the vehicle stands.

        Return when zero was asked for; None when safety did not let the source in at all.
        """
        try:
            self._wish = STILL
            if not self.until(self._let_in, READY_S):
                return None
            self._wish = asked
            self.until(lambda: self._must_stop(asked), seconds)
            released_ns = time.monotonic_ns()
            self._wish = STILL
            self.until(lambda: self._stands(released_ns), REST_S)
            self.listen(ZEROS_S)
            return released_ns
        finally:
            # Whatever ended it: a last zero at once. What follows is silence, which is a release.
            self._wish = None
            self._source.ask(0.0, 0.0)

    def _let_in(self) -> bool:
        if not self.tape.safety or not self.tape.links:
            return False
        state, link = self.tape.safety[-1].value, self.tape.links[-1].value
        return state.source == SOURCE and state.verdict in ("run", "slow") and link.armed

    def _must_stop(self, asked: Twist) -> bool:
        fast = bool(self.tape.velocities) and too_fast(asked, self.tape.velocities[-1].value)
        return fast or bool(self.latched())

    def _stands(self, since_ns: int) -> bool:
        if (
            not self.tape.velocities
            or self.tape.velocities[-1].received_ns < since_ns + NS_PER_S // 4
        ):
            return False
        velocity = self.tape.velocities[-1].value
        return is_standing(velocity.linear, velocity.angular)

    def _ask(self, _: int) -> None:
        if self._wish is not None:
            self._source.ask(self._wish.linear, self._wish.angular)

    def _look(self, _: int) -> None:
        if self._done():
            self.loop.stop()
