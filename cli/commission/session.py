"""Session of the checkout: the client of safety, with a log of all messages since a mark."""

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import msgspec

from cli.commission.latches import Reset
from cli.commission.motion import too_fast
from cli.inspect.addressing import decode, topic_of
from cli.inspect.client import SafetyClient
from cli.inspect.session import decoded
from common import clock
from common.bus.inspector import Inspector, inspecting
from common.config import Setting
from common.freshness import NS_PER_S, Latest
from common.motion import Twist
from common.settings import Shared
from t2 import keys
from t2.client import request, reset_request
from t2.codec import Sample
from t2.errors import LinkError, MessageError, T2Error
from t2.keys import Topic
from t2.messages import Message, ResetDone
from t2.words import Language, render

SOURCE = "checkout"  # as in safety's settings
STACK_S = 10.0
READY_S = 8.0  # wait for safety to grant motion; a cause that clears by itself needs 0.5 s
REST_S = 3.0  # wait for standstill after the last request
ZEROS_S = 0.15  # three requests
TOPICS = (keys.LINK, keys.MOTION, keys.VELOCITY, keys.MILEAGE, keys.ULTRASONIC, keys.BUMPER,
          keys.SWITCHES, keys.DRIVER, keys.HEALTH)  # fmt: skip

M = TypeVar("M", bound=Message)


class CheckoutSession(SafetyClient):
    """One checkout on a bus."""

    def __init__(self, opened: Inspector, robot: str, language: Language = "en") -> None:
        """Listen to the robot; ``language`` is that of safety's texts."""
        super().__init__(opened, robot, SOURCE, language)
        self._marked_ns = 0
        self._log: defaultdict[str, list[Any]] = defaultdict(list)
        for topic in TOPICS:
            opened.listen(topic.on(robot, side="*", service="*"))

    def mark(self) -> int:
        """Discard everything received until now, queued messages too; return the time."""
        self.forget()
        self._marked_ns = clock.now_ns()
        for log in self._log.values():
            log.clear()
        return self._marked_ns

    def of(self, topic: Topic[M]) -> list[Latest[M]]:
        """Return the messages of a topic since the mark, each with its local receive time."""
        return self._log[topic.path]

    def receive(self, sample: Sample) -> None:
        """Log one message of the bus."""
        super().receive(sample)
        topic = topic_of(sample.key)
        if topic is None or sample.received_ns < self._marked_ns:
            return
        try:
            message = decode(sample, topic.message)
        except MessageError:
            return
        self._log[topic.path].append(Latest(message, sample.received_ns))

    def listen(self, seconds: float) -> None:
        """Receive for a time."""
        self.until(lambda: False, seconds)

    def settings(self, service: str) -> dict[str, Setting]:
        """Return a service's settings by path; raise ``LinkError`` without an answer."""
        for answer in self.inspector.query(keys.info_key(self.robot, service, "config")):
            if not answer.refusal:
                return msgspec.json.decode(answer.payload, type=dict[str, Setting])
        raise LinkError(f"cannot read the settings of {service}: it does not answer")

    def latched(self) -> tuple[str, ...]:
        """Return the latched causes of safety's newest state."""
        return self.state.latched if self.state else ()

    def reset(self) -> Reset:
        """Request a reset of the latched causes, and return what stays latched."""
        requested_ns = clock.now_ns()
        try:
            seen = self.fresh_state()
            requested_ns = self.mark()
            answers = self.call(keys.RESET, reset_request(seen))
            if not self.is_reset(seen, answers):
                raise T2Error("safety's state does not show it")
        except T2Error as error:
            return Reset(requested_ns, False, str(error), self.latched())
        done = decoded(answers, ResetDone)
        text = " ".join(render(one.phrases, self.language, one.text) for one in done)
        return Reset(requested_ns, True, text, self.latched())

    def drive(self, requested: Twist, seconds: float) -> int | None:
        """Request a motion, then zero until the vehicle stands.

        Return the time at which zero was first requested; None if safety did not grant motion, or
        has latched before.
        """
        try:
            self.requested = request()
            self.until(lambda: self.latched() or self._is_granted(), READY_S)
            if self.latched() or not self._is_granted():
                return None
            self.requested = request(requested.linear, requested.angular)
            self.until(lambda: self._must_stop(requested), seconds)
            ended_ns = clock.now_ns()
            self.requested = request()
            self.until(lambda: self._stands(ended_ns), REST_S)
            return ended_ns
        finally:
            # On every way out: zeros, the first one at once. The silence after them is letting go.
            self.requested = None
            self.tick()
            self.listen(ZEROS_S)

    def _is_granted(self) -> bool:
        if not self.state or not self.of(keys.LINK):
            return False
        link = self.of(keys.LINK)[-1].value
        return self.state.source == SOURCE and self.state.verdict in ("run", "slow") and link.armed

    def _must_stop(self, requested: Twist) -> bool:
        velocities = self.of(keys.VELOCITY)
        fast = bool(velocities) and too_fast(requested, velocities[-1].value)
        return fast or bool(self.latched())

    def _stands(self, since_ns: int) -> bool:
        velocities = self.of(keys.VELOCITY)
        if not velocities or velocities[-1].received_ns < since_ns + NS_PER_S // 4:
            return False
        newest = velocities[-1].value
        return Twist(newest.linear, newest.angular).is_standing


@contextmanager
def checkout_session(config: Shared, language: Language = "en") -> Iterator[CheckoutSession]:
    """Open a session for the context; raise ``LinkError`` without a stack."""
    with inspecting(config.bus) as opened:
        session = CheckoutSession(opened, config.robot.id, language)
        if not session.until(lambda: session.of(keys.LINK) and session.state, STACK_S):
            raise LinkError(
                f"no message of bridge and safety on {', '.join(config.bus.endpoints)}; "
                "start `t2 up --no-sim --config config/vehicle.toml` first"
            )
        yield session
