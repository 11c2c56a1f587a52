"""Bus shell of the safety service: subscribes to inputs and publishes verdicts.

All decisions are made by ``Policy``, 50 times a second, on the newest samples and requests. What
cannot wait is decided at once: a bumper that is hit or free again, a driver fault, an emergency
stop, a reset. A motion leaves at each of the 50 decisions, and at once if its command is more
severe than the last one, or if it acknowledges a hit; then it takes the place of the next regular
one. So no member of the bus can raise the rate of decisions or of frames to the board.
"""

from collections.abc import Callable, Collection
from functools import partial
from typing import TypeVar

from msgspec.structs import replace

from common import clock, realtime
from common.bus.bus import Arrival, Bus, Caller
from common.freshness import NS_PER_S, Latest, fresh
from common.heartbeat import Heartbeat
from common.motion import BRAKE, RUN, STOP
from common.service import Node
from services.safety.config import DECISION_PERIOD_S, SafetyConfig
from services.safety.core.conditions import LOST_SAMPLES
from services.safety.core.inputs import (
    DriveRequest,
    Inputs,
    LimitRequest,
    SourceRequest,
)
from services.safety.core.policy import Policy
from services.safety.core.state import Reply, State
from services.safety.report import signature, state_message, transitions
from t2 import keys
from t2.keys import Topic
from t2.messages import (
    Bumper,
    Driver,
    Message,
    Motion,
    Phrase,
    ResetDone,
    ResetRequest,
    SafetyState,
)
from t2.words import render

M = TypeVar("M", bound=Message)

SEVERITY = {RUN: 0, STOP: 1, BRAKE: 2}
STATE_PERIOD_S = 1 / 20
# A single sample latches a hit or a driver fault, and the next one may already be clear. So no
# sample may be dropped or skipped, even after a stall of a second.
LATCHING_DEPTH = 64
DRIVE_DEPTH = 64
STREAM_DEPTH = 4  # samples that come between two decisions


class SafetyService:
    """Stores the newest samples, decides, and publishes the results."""

    def __init__(self, node: Node[SafetyConfig], estop_bus: Bus) -> None:
        self._node = node
        self._estop_bus = estop_bus
        self._policy = Policy(node.config)
        # Random start, so that echoes and identities of an earlier start are unknown.
        start = node.bus.boot % 2**31
        self._state = replace(self._policy.start(), heartbeat=Heartbeat(start), decision=start)
        self._inputs = Inputs(boot=node.bus.boot)
        self._motion_publisher = node.open_drive(listens=False).publisher(keys.MOTION)
        self._state_publisher = node.bus.publisher(keys.SAFETY)
        self._subscribe()
        node.is_stopped = self._is_stopped
        self._sent = STOP  # command of the newest motion
        self._has_turn = True  # False while a motion has left in the place of the next regular one
        self._hit_due = False  # a hit, for whose acknowledgement the bridge waits
        self._estop_due = False  # another emergency stop while one is latched
        self._may_reset = True  # one reset a period
        self._refused_ns = 0  # when a refused reset was last reported
        node.loop.every(DECISION_PERIOD_S, self._on_tick)
        node.loop.every(STATE_PERIOD_S, self._publish_state)

    def _subscribe(self) -> None:
        self._subscribe_measurements()
        settings = self._node.config.safety
        self._subscribe_source(keys.DRIVE, DriveRequest, settings.sources)
        self._subscribe_source(keys.LIMIT, LimitRequest, settings.limits)
        self._node.bus.serve(keys.RESET, self._on_reset)
        estop_key = keys.estop_key(self._node.config.robot.id)
        self._estop_bus.on_any(estop_key, lambda _: self._on_estop())
        self._estop_bus.subscribe(keys.SAFETY, self._on_estop_path)

    def _subscribe_source(
        self,
        topic: Topic[M],
        request: Callable[[str, M | None, int], SourceRequest],
        known: Collection[str],
    ) -> None:
        """Accept the messages of sources until the next decision; count the refused ones.

        The key of each known source is announced: to a client whose rights cover only one source,
        the router announces only subscribers of exactly its key.
        """

        def accept(arrival: Arrival[M]) -> None:
            source = source_of(arrival.key)
            self._accept(request(source, arrival.message, arrival.received_ns))

        bus = self._node.bus
        bus.subscribe(
            topic,
            accept,
            depth=DRIVE_DEPTH,
            refused=lambda key, _: self._accept(request(source_of(key), None, 0)),
            source="*",
        )
        for source in known:
            bus.announce(topic.on(self._node.config.robot.id, source=source))

    def _subscribe_measurements(self) -> None:
        """Subscribe to the bridge's measurements, on the drive link only."""
        drive = self._node.drive
        waiting = partial(drive.subscribe, depth=STREAM_DEPTH, post=self._node.loop.defer)
        waiting(keys.VELOCITY, self._store("velocity"))
        waiting(keys.MILEAGE, self._store("mileage"))
        waiting(keys.ULTRASONIC, self._store("ultrasonic"))
        waiting(keys.SWITCHES, self._store("switches"))
        waiting(keys.LINK, self._store("link"))
        drive.subscribe(keys.BUMPER, self._on_bumper, depth=LATCHING_DEPTH)
        for side in ("left", "right"):
            drive.subscribe(keys.DRIVER, self._store_driver(side), depth=LATCHING_DEPTH, side=side)

    def _store(self, field: str) -> Callable[[Arrival[M]], None]:
        """Return a handler that stores the newest sample in this field of the inputs."""

        def store(arrival: Arrival[M]) -> None:
            latest = Latest(arrival.message, arrival.received_ns)
            self._inputs = replace(self._inputs, **{field: latest})

        return store

    def _store_driver(self, side: str) -> Callable[[Arrival[Driver]], None]:
        """Return a handler that stores a sample, and decides on a fault at once."""
        store = self._store(side)

        def on_driver(arrival: Arrival[Driver]) -> None:
            store(arrival)
            if arrival.message.has_fault:
                self._decide()

        return on_driver

    def _on_estop_path(self, arrival: Arrival[SafetyState]) -> None:
        if arrival.message.boot == self._node.bus.boot:  # not of a second safety
            self._store("estop_path")(arrival)

    def _on_bumper(self, arrival: Arrival[Bumper]) -> None:
        bumper, before = arrival.message, self._inputs.bumper
        age_s = self._node.config.times.bumper_age
        if before is not None and not fresh(before, arrival.received_ns, age_s):
            self._decide()  # no decision may have fallen into the gap that this sample ends
        self._store("bumper")(arrival)
        was_pressed = before is not None and before.value.pressed
        self._hit_due |= bumper.pressed and not was_pressed
        # A clear sample between two hits ends a release. A decision counts the samples since the
        # last one: too many would look like lost ones.
        unjudged = bumper.seq - self._state.verdict.judged[1]
        if bumper.pressed != was_pressed or unjudged >= LOST_SAMPLES:
            self._decide()

    def _accept(self, request: SourceRequest) -> None:
        self._state, refused = self._policy.accept(self._state, request, clock.now_ns())
        if refused:
            self._node.counters[f"refused_{refused}"] += 1

    def _on_estop(self) -> None:
        self._estop_due = True
        if "estop" not in self._state.latches:
            self._decide()

    def _on_tick(self, _: int) -> None:
        self._may_reset = True
        self._decide(is_tick=True)

    def _on_reset(self, request: ResetRequest, caller: Caller[ResetDone]) -> None:
        if not self._may_reset:
            caller.refuse(Phrase("reset.pending"))
            return
        self._may_reset = False

        def answer(reply: Reply) -> None:
            if not reply.done:
                caller.refuse(*reply.phrases)
                return
            # The state published right after this is the first one that shows the effect.
            heartbeat = self._state.heartbeat.number + 1
            boot = self._node.bus.boot
            caller.reply(
                ResetDone(
                    text=render(reply.phrases),
                    phrases=reply.phrases,
                    boot=boot,
                    heartbeat=heartbeat,
                    cleared=reply.cleared,
                )
            )

        self._decide(request, answer)

    def _decide(
        self,
        reset: ResetRequest | None = None,
        answer: Callable[[Reply], None] | None = None,
        *,
        is_tick: bool = False,
    ) -> None:
        now_ns, before = clock.now_ns(), self._state
        inputs = replace(
            self._inputs,
            estop_connection=self._estop_bus.connection,
            estop=self._estop_due,
            reset=reset,
        )
        self._estop_due = False
        decision = self._policy.decide(before, inputs, now_ns)
        self._state = decision.state
        self._send(decision.motion, is_tick=is_tick)
        self._report(before, answer, now_ns)

    def _send(self, motion: Motion, *, is_tick: bool) -> None:
        """Publish a motion in its turn, or at once if it may not wait."""
        is_severe = SEVERITY[motion.command] > SEVERITY[self._sent]
        has_turn, self._has_turn = self._has_turn, self._has_turn or is_tick
        if is_severe or (has_turn and (is_tick or self._hit_due)):
            self._has_turn = is_tick
            self._sent, self._hit_due = motion.command, False
            self._motion_publisher.put(motion)
            realtime.give_way()

    def _report(self, before: State, answer: Callable[[Reply], None] | None, now_ns: int) -> None:
        verdict = self._state.verdict
        if answer and verdict.reply:
            answer(verdict.reply)
        if signature(before) != signature(self._state):
            self._publish_state(now_ns)
        for transition in transitions(before, self._state):
            if transition.name == "reset_refused":
                # Repeated calls must not push other events out of the history.
                if now_ns - self._refused_ns < NS_PER_S:
                    continue
                self._refused_ns = now_ns
            self._node.event(
                transition.name, transition.level, *transition.phrases, **transition.about
            )

    def _publish_state(self, now_ns: int) -> None:
        self._state = replace(self._state, heartbeat=self._state.heartbeat.beat(now_ns))
        self._state_publisher.put(state_message(self._policy, self._state, now_ns))

    def _is_stopped(self) -> bool:
        """Stop the vehicle before shutdown; do not wait for an unknown velocity."""
        if not self._inputs.leaving:
            self._inputs = replace(self._inputs, leaving=True)
            self._decide()
        measured = self._inputs.measured
        return measured is None or measured.value.is_standing


def source_of(key: str) -> str:
    """Return the source in a key such as ``.../@cmd/drive/{source}``."""
    return key.rsplit("/", 1)[-1]
