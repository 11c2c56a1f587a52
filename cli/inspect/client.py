"""Client of safety for a tool: the state machines of ``t2.client`` on an inspector.

Everything runs in the tool's own thread: messages are taken and the drive request of each tick is
sent only inside ``until``. While a tool waits for its user nothing is sent, which lets go, and
messages queue up: ``until`` takes all of them before it judges, and ``fresh_state`` none.
"""

import secrets
import time
from collections.abc import Callable, Iterable
from itertools import count
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from cli.inspect.addressing import chunks
from cli.inspect.session import decoded, services
from common import clock
from common.bus.bus import no_answer, not_allowed
from common.bus.inspector import Answer, Inspector
from common.bus.publisher import host_id
from common.freshness import NS_PER_S
from t2 import codec, keys
from t2.client import DriveRequests, EstopRepetition, EstopStep, ResetCheck
from t2.codec import Sample
from t2.errors import T2Error
from t2.keys import Call, Topic
from t2.messages import Drive, Event, Phrase, ResetDone, SafetyState, SourceMessage
from t2.words import Language, render

TICK_S = 0.05  # as ``t2.client`` expects
STATE_S = 1.0  # wait for a state of safety, which has 20 Hz


class SafetyClient:
    """Client of one robot's safety; a key expression as robot serves ``stop`` only."""

    def __init__(
        self, inspector: Inspector, robot: str, source: str = "", language: Language = "en"
    ) -> None:
        """Listen to safety; ``source`` is the name in drive requests and keepalives.

        ``language`` is that of refusals.
        """
        self.inspector = inspector
        self.robot = robot
        self.language = language
        self.states: dict[str, SafetyState] = {}  # the newest by robot
        self._received_ns: dict[str, int] = {}
        self.requested: Drive | None = None  # sent on each tick, with its neutral requests
        self._source = source
        self._drive = DriveRequests()
        self._stops: dict[str, EstopRepetition] = {}
        self._header = {"boot": secrets.randbits(63), "host": host_id()}
        self._seq = count(1)
        self._due_s = 0.0
        inspector.listen(keys.SAFETY.on(robot))

    @property
    def state(self) -> SafetyState | None:
        """The newest state of the robot."""
        return self.states.get(self.robot)

    def is_silent(self, seconds: float) -> bool:
        """Return whether no state of the robot has arrived for so long, or none at all."""
        received_ns = self._received_ns.get(self.robot)
        return received_ns is None or clock.now_ns() - received_ns > seconds * NS_PER_S

    def until(self, condition: Callable[[], object], timeout_s: float) -> bool:
        """Receive and tick until the condition holds or the timeout expires; return which.

        The condition sees what has arrived, not what was queued first.
        """
        end_s = time.monotonic() + timeout_s
        while True:
            now_s = time.monotonic()
            if now_s >= self._due_s:
                self._due_s = now_s + TICK_S
                self.tick()
            for queued in self.inspector.queued():
                self.receive(queued)
            if condition():
                return True
            if now_s >= end_s:
                return False
            if sample := self.inspector.take(min(end_s, self._due_s) - now_s):
                self.receive(sample)

    def receive(self, sample: Sample) -> None:
        """Take one message of the bus."""
        robot, path = chunks(sample.key)
        if path == keys.SAFETY.path:
            for state in decoded([sample], SafetyState):
                self.states[robot], self._received_ns[robot] = state, sample.received_ns

    def tick(self) -> None:
        """Send what is due."""
        if drive := self._drive.tick(self.requested):
            self.put(keys.DRIVE, drive)
        for robot, stop in self._stops.items():
            if stop.tick(self.states.get(robot)) is not EstopStep.NONE:
                self.order_stop(robot)

    def put(self, topic: Topic[Any], message: SourceMessage) -> None:
        """Publish a message of this source, with its header and the newest heartbeat."""
        echo = self.state.heartbeat if self.state else 0
        whole = replace(message, echo=echo, **self._stamp())
        key = topic.on(self.robot, source=self._source)
        self.inspector.put(key, codec.encode(whole), codec.encoding(topic.message), topic.service)

    def _stamp(self) -> dict[str, int]:
        now = {"seq": next(self._seq), "t_ns": time.time_ns(), "mono_ns": clock.now_ns()}
        return now | self._header

    def report_stop(self, robot: str, user: str) -> None:
        """Publish the event of an emergency stop by this user."""
        phrases, stamp = (Phrase("event.estop", {"by": user}),), self._stamp()
        event = Event(
            name="estop", level="warning", text=render(phrases), phrases=phrases,
            about={"by": user},
        )  # fmt: skip
        event = replace(event, **stamp)
        key = keys.EVENTS.on(robot, service="estop")
        self.inspector.put(key, codec.encode(event), codec.encoding(Event), keys.EVENTS.service)

    def order_stop(self, robot: str) -> None:
        """Publish an emergency stop once."""
        self.inspector.put(keys.estop_key(robot), b"", codec.ENCODING, keys.ESTOP_CLASS)

    def stop(self, robots: Iterable[str], seconds: float | None = None) -> set[str]:
        """Repeat an emergency stop until all have latched it; return the robots that have.

        ``seconds`` replaces the 3 s after which it counts as not confirmed.
        """
        self.forget()
        self.begin_stop(robots, None if seconds is None else max(1, round(seconds / TICK_S)))
        while self.is_stopping:
            if "*" in self.robot:  # for robots that are not known here
                self.order_stop(self.robot)
            self.until(lambda: False, TICK_S)
        return {robot for robot, state in self.states.items() if "estop" in state.latched}

    def begin_stop(self, robots: Iterable[str], ticks: int | None = None) -> None:
        """Repeat an emergency stop on each tick until all have latched it, after the first one."""
        self._stops = {robot: EstopRepetition() for robot in robots}
        for robot, stop in self._stops.items():
            stop.start(self.states.get(robot), ticks)

    @property
    def is_stopping(self) -> bool:
        """Whether an emergency stop is still repeated."""
        return any(stop.is_pending for stop in self._stops.values())

    def fall_silent(self) -> None:
        """Send no more requests, and no zeros either: the lease of the last one ends."""
        self.requested, self._drive = None, DriveRequests()

    def forget(self) -> None:
        """Discard what has arrived: only states that arrive from now on count."""
        self.inspector.discard()
        self.states.clear()

    def fresh_state(self) -> SafetyState:
        """Return a state that arrives from now on; raise ``T2Error`` without one."""
        self.forget()
        if not self.until(lambda: self.state, STATE_S) or self.state is None:
            raise T2Error(
                f"no state of safety within {STATE_S:g} s: is safety running? "
                f"run {self.inspector.doctor}"
            )
        return self.state

    def call(self, call: Call[Any, Any], request: Struct, timeout_s: float = 2.0) -> list[Answer]:
        """Return the answers to a call; raise ``T2Error`` if it is refused or not answered."""
        key = call.on(self.robot)
        answers = self.inspector.query(key, codec.encode(request), timeout_s)
        if not answers:
            raise T2Error(f"{key}: {self._why_unanswered(call, key)}")
        if refusals := [answer.refusal for answer in answers if answer.refusal]:
            texts = (render(it.phrases, self.language, it.text) for it in refusals)
            raise T2Error(f"refused: {' '.join(texts)}")
        return answers

    def is_reset(self, seen: SafetyState, answers: Iterable[Answer]) -> bool:
        """Return whether safety's state soon shows the reset that one of the answers claims."""
        checks = []
        for done in decoded(answers, ResetDone):
            checks.append(ResetCheck(seen))
            checks[-1].answer(done)

        def outcomes() -> list[bool | None]:
            return [check.outcome(self.state, clock.now_ns()) for check in checks]

        self.until(lambda: None not in (found := outcomes()) or True in found, float("inf"))
        return True in outcomes()

    def _why_unanswered(self, call: Call[Any, Any], key: str) -> str:
        """Return why: the service is absent or hangs, or the router drops the call.

        The router announces no queryable to a certificate that may not call it.
        """
        runs = services(self.inspector, self.robot, call.server)
        barred = runs and not self.inspector.has_server(key)
        why = not_allowed(call.server) if barred else no_answer(call.server, self.inspector.doctor)
        return render(why.phrases, self.language, why.text)
