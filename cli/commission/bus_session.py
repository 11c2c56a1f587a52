"""Bus session of the checkout: waits for conditions, calls services, and drives while it waits.

Everything runs in one thread. The loop turns only while the session waits. During a question to the
operator the loop stands still and so does the vehicle: missing requests are a release.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import msgspec
from msgspec import Struct

from cli.commission.latches import Reset
from cli.commission.motion import too_fast
from cli.commission.operator import confirm
from common import clock, keys
from common.bus.bus import Arrival, Bus
from common.client import reset_request
from common.config import Setting
from common.errors import LinkError
from common.freshness import NS_PER_S, Latest
from common.keys import Call, Topic
from common.loop import Loop
from common.messages import Message
from common.motion import STILL, Twist
from common.settings import Shared
from common.source import DriveSource

SOURCE = "checkout"  # as in safety's settings
REQUEST_S, POLL_S = 0.05, 0.02
ROUTER_S = 10.0
READY_S = 8.0  # wait for safety to grant motion; a cause that clears by itself needs 0.5 s
REST_S = 3.0  # wait for standstill after the release
ZEROS_S = 0.15  # three requests
AFTER_S = 2.0  # wait for safety's state without a latch
PHRASE = "reset"
DEPTH = 64  # more than arrives between two rounds of the loop
PAYLOAD_OFFSET = 8  # of a frame

M = TypeVar("M", bound=Message)


class MessageLog:
    """Messages since the last mark, each with its local receive time."""

    def __init__(self, bus: Bus) -> None:
        self.frames = 0  # received with the board's bytes
        self.nonzero = 0  # of these, with a payload that is not all zeros
        self._bus = bus
        self._marked_ns = 0
        self._lists: list[list[Any]] = []
        self.links = self._recorded(keys.LINK)
        self.safety = self._recorded(keys.SAFETY)
        self.motions = self._recorded(keys.MOTION)
        self.velocities = self._recorded(keys.VELOCITY)
        self.mileages = self._recorded(keys.MILEAGE)
        self.ultrasonics = self._recorded(keys.ULTRASONIC)
        self.bumpers = self._recorded(keys.BUMPER)
        self.switches = self._recorded(keys.SWITCHES)
        self.health = self._recorded(keys.HEALTH, service="*")
        self._recorded(keys.DRIVER, side="*")  # the board's frames of the motor drivers count

    def mark(self) -> int:
        """Discard everything received until now, queued messages too; return the time."""
        self._marked_ns = clock.now_ns()
        for log in self._lists:
            log.clear()
        self.frames = self.nonzero = 0
        return self._marked_ns

    def _recorded(self, topic: Topic[M], **names: Any) -> list[Latest[M]]:
        log: list[Latest[M]] = []

        def take(arrival: Arrival[M]) -> None:
            if arrival.received_ns < self._marked_ns:
                return
            log.append(Latest(arrival.message, arrival.received_ns))
            if arrival.raw:
                self.frames += 1
                self.nonzero += any(arrival.raw[PAYLOAD_OFFSET:])

        self._lists.append(log)
        self._bus.subscribe(topic, take, depth=DEPTH, **names)
        return log


class CheckoutSession:
    """One checkout on a bus."""

    def __init__(self, config: Shared) -> None:
        self.loop = Loop()
        self.bus = Bus(config.bus, config.robot.id, self.loop.post)
        self.log = MessageLog(self.bus)
        self._endpoints = ", ".join(config.bus.endpoints)
        self._source = DriveSource(self.bus, SOURCE)
        self._requested: Twist | None = None
        self._done: Callable[[], object] = lambda: True
        self.loop.every(REQUEST_S, self._request)
        self.loop.every(POLL_S, self._poll)

    @contextmanager
    def opened(self) -> "Iterator[CheckoutSession]":
        """Keep the session open during the context; raise ``LinkError`` without a stack."""
        self.bus.open()
        try:
            if not self.until(lambda: self.log.links and self.log.safety, ROUTER_S):
                raise LinkError(
                    f"no message of bridge and safety on {self._endpoints}; "
                    "start `t2 up --no-sim --config config/vehicle.toml` first"
                )
            yield self
        finally:
            self.bus.close()
            self.loop.close()

    def until(self, condition: Callable[[], object], timeout_s: float) -> bool:
        """Run the loop until the condition holds or the timeout expires; return the condition."""
        end_ns = clock.now_ns() + round(timeout_s * NS_PER_S)
        self._done = lambda: condition() or clock.now_ns() > end_ns
        self.loop.run()
        return bool(condition())

    def listen(self, seconds: float) -> None:
        """Run the loop for a time."""
        self.until(lambda: False, seconds)

    def call(self, call: Call[Any, Any], request: Struct) -> tuple[bool, str]:
        """Make a call; return whether it succeeded, and the text of the answer."""
        answers: list[tuple[bool, str]] = []
        self.bus.call(
            call,
            request,
            lambda done: answers.append((True, done.text)),
            lambda reason: answers.append((False, reason)),
        )
        self.until(lambda: answers, ROUTER_S)
        return answers[0] if answers else (False, "no answer")

    def settings(self, service: str) -> dict[str, Setting]:
        """Return a service's settings by path; raise ``LinkError`` without an answer."""
        answers: list[bytes] = []
        refusals: list[str] = []
        self.bus.look_up(service, "config", answers.append, refusals.append)
        self.until(lambda: answers or refusals, ROUTER_S)
        if not answers:
            reason = refusals[0] if refusals else "no answer"
            raise LinkError(f"cannot read the settings of {service}: {reason}")
        return msgspec.json.decode(answers[0], type=dict[str, Setting])

    def latched(self) -> tuple[str, ...]:
        """Return the latched causes of safety's newest state."""
        return self.log.safety[-1].value.latched if self.log.safety else ()

    def reset(self) -> Reset:
        """Request a reset of the latched causes, and return what stays latched."""
        log = self.log
        log.mark()
        self.until(lambda: log.safety, AFTER_S)
        if not log.safety:
            return Reset(log.mark(), False, "no state of safety arrives", ())
        request = reset_request(log.safety[-1].value)
        requested_ns = log.mark()
        granted, text = self.call(keys.RESET, request)
        self.until(lambda: log.safety and not (granted and self.latched()), AFTER_S)
        return Reset(requested_ns, granted, text, self.latched())

    def unlatch(self) -> str:
        """Reset earlier latches after confirmation; return the problem, or an empty string."""
        self.log.mark()
        self.until(lambda: self.log.safety, AFTER_S)
        if not self.latched():
            return ""
        fact = f"Safety has latched before: {', '.join(self.latched())}. Reset it first."
        if not confirm(fact, PHRASE):
            return "The earlier latch of safety was not reset."
        done = self.reset()
        return "" if done.granted and not done.latched else f"The reset was refused: {done.text}"

    def drive(self, requested: Twist, seconds: float) -> int | None:
        """Request a motion, then zero until the vehicle stands.

        Return the time at which zero was first requested; None if safety did not grant motion.
        """
        try:
            self._requested = STILL
            if not self.until(self._is_granted, READY_S):
                return None
            self._requested = requested
            self.until(lambda: self._must_stop(requested), seconds)
            released_ns = clock.now_ns()
            self._requested = STILL
            self.until(lambda: self._stands(released_ns), REST_S)
            self.listen(ZEROS_S)
            return released_ns
        finally:
            # On every way out: a last zero at once. The silence after it is a release.
            self._requested = None
            self._source.request(0.0, 0.0)

    def _is_granted(self) -> bool:
        if not self.log.safety or not self.log.links:
            return False
        state, link = self.log.safety[-1].value, self.log.links[-1].value
        return state.source == SOURCE and state.verdict in ("run", "slow") and link.armed

    def _must_stop(self, requested: Twist) -> bool:
        velocities = self.log.velocities
        fast = bool(velocities) and too_fast(requested, velocities[-1].value)
        return fast or bool(self.latched())

    def _stands(self, since_ns: int) -> bool:
        velocities = self.log.velocities
        if not velocities or velocities[-1].received_ns < since_ns + NS_PER_S // 4:
            return False
        velocity = velocities[-1].value
        return Twist(velocity.linear, velocity.angular).is_standing

    def _request(self, _: int) -> None:
        if self._requested is not None:
            self._source.request(self._requested.linear, self._requested.angular)

    def _poll(self, _: int) -> None:
        if self._done():
            self.loop.stop()
