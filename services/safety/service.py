"""The safety service on the bus: streams in, verdicts out; decides nothing itself."""

import time
from collections.abc import Callable
from typing import TypeVar

from msgspec.structs import replace

from common import keys
from common.bus.bus import Arrival, Bus
from common.bus.calls import Caller
from common.errors import MessageError
from common.freshness import Latest
from common.heartbeat import Heartbeat
from common.messages import Done, Drive, Message, ReleaseRequest, ResetDone, ResetRequest
from common.service import Node
from services.safety.config import SafetyConfig
from services.safety.inputs import Ask, Estop, Event, Hold, Inputs, Reset
from services.safety.policy import Policy
from services.safety.report import motion_message, notes, signature, state_message, timed
from services.safety.state import Reply

M = TypeVar("M", bound=Message)

DECIDE_S = 1 / 50  # from one decision to the next, at most
TELL_S = 1 / 20
# One sample latches, a hit or a driver's fault, and the next one may say that it is over: none must
# be pushed out or left undecided, even after a second's stall.
LATCHING_DEPTH = 64
DRIVE_DEPTH = 64


class Ports:
    """Keeps the newest samples, decides on each event, and publishes what comes out."""

    def __init__(self, node: Node[SafetyConfig], reader: Bus) -> None:
        self._node = node
        self._reader = reader
        self._policy = Policy(node.config.safety, node.config.vehicle)
        # Echoes and identities of an earlier start must be unknown to this one.
        start = node.bus.boot % 2**31
        self._state = replace(self._policy.start(), heartbeat=Heartbeat(start), decision=start)
        self._inputs = Inputs(boot=node.bus.boot)
        self._motion = node.open_drive(listens=False).publisher(keys.MOTION)
        self._safety = node.bus.publisher(keys.SAFETY)
        self._listen()
        node.is_stopped = self._come_to_rest
        self._due = node.loop.every(DECIDE_S, lambda _: self._decide())
        node.loop.every(TELL_S, self._tell)

    def _listen(self) -> None:
        self._measure()
        bus, robot = self._node.bus, self._node.config.robot.id
        bus.subscribe(
            keys.DRIVE,
            self._ask,
            depth=DRIVE_DEPTH,
            refused=self._no_request,
            known=self._node.config.safety.sources,
            source="*",
        )
        for source in self._node.config.safety.sources:
            # To a driver bound to this source a router announces only readers of exactly this key.
            bus.announce(keys.DRIVE.on(robot, source=source))
        bus.serve(keys.RESET, self._reset)
        bus.serve(keys.RELEASE, self._hold)
        self._reader.on_any(keys.estop_key(robot), lambda _: self._decide(Estop()))
        self._reader.subscribe(keys.SAFETY, self._keep("estop_path"))

    def _measure(self) -> None:
        """Subscribe the bridge's measurements, on the drive link alone."""
        drive = self._node.drive
        drive.subscribe(keys.VELOCITY, self._keep("velocity"))
        drive.subscribe(keys.MILEAGE, self._keep("mileage"))
        drive.subscribe(keys.ULTRASONIC, self._keep("ultrasonic", at_once=True))
        drive.subscribe(keys.BUMPER, self._keep("bumper", at_once=True), depth=LATCHING_DEPTH)
        for side in ("left", "right"):
            drive.subscribe(
                keys.DRIVER, self._keep(side, at_once=True), depth=LATCHING_DEPTH, side=side
            )
        drive.subscribe(keys.SWITCHES, self._keep("switches"))
        drive.subscribe(keys.LINK, self._keep("link"))

    def _keep(self, field: str, *, at_once: bool = False) -> Callable[[Arrival[M]], None]:
        """Return a handler that keeps the newest sample in the inputs' field of that name."""

        def take(arrival: Arrival[M]) -> None:
            latest = Latest(arrival.message, arrival.received_ns)
            self._inputs = replace(self._inputs, **{field: latest})
            if at_once:
                self._decide()

        return take

    def _ask(self, arrival: Arrival[Drive]) -> None:
        source, drive = source_of(arrival.key), arrival.message
        shared = self._node.bus.shares_clock(drive)
        self._decide(Ask(source, drive, arrival.received_ns, shared))

    def _no_request(self, key: str, _: MessageError) -> None:
        self._decide(Ask(source_of(key), None))

    def _reset(self, request: ResetRequest, caller: Caller[ResetDone]) -> None:
        def answer(reply: Reply) -> None:
            if not reply.done:
                caller.refuse(reply.text)
                return
            # The state that follows at once is the first one that shows the effect.
            heartbeat = self._state.heartbeat.number + 1
            boot = self._node.bus.boot
            caller.reply(
                ResetDone(text=reply.text, boot=boot, heartbeat=heartbeat, cleared=reply.cleared)
            )

        self._decide(Reset(request.echo, request.causes), answer)

    def _hold(self, request: ReleaseRequest, caller: Caller[Done]) -> None:
        def answer(reply: Reply) -> None:
            if reply.done:
                caller.reply(Done(text=reply.text, boot=self._node.bus.boot))
            else:
                caller.refuse(reply.text)

        self._decide(Hold(request.held, request.direction, request.echo), answer)

    def _decide(
        self, event: Event | None = None, answer: Callable[[Reply], None] | None = None
    ) -> None:
        now_ns = time.monotonic_ns()
        self._due.put_off(now_ns)
        inputs = replace(self._inputs, reader=self._reader.connected, event=event)
        before = self._state
        self._state, verdict = self._policy.decide(before, inputs, now_ns)
        self._motion.put(timed(motion_message(self._state, inputs), self._state, inputs))
        if verdict.refused:
            self._node.counters[f"refused_{verdict.refused}"] += 1
        if answer and verdict.reply:
            answer(verdict.reply)
        if signature(before) != signature(self._state):
            self._tell(now_ns)
        for note in notes(before, self._state, event):
            self._node.event(note.name, note.level, note.text, **note.about)

    def _tell(self, now_ns: int) -> None:
        self._state = replace(self._state, heartbeat=self._state.heartbeat.beat(now_ns))
        self._safety.put(state_message(self._policy, self._state, now_ns))

    def _come_to_rest(self) -> bool:
        """Stop the vehicle before the service ends; an unknown speed is not waited for."""
        if not self._inputs.leaving:
            self._inputs = replace(self._inputs, leaving=True)
            self._decide()
        measured = self._inputs.measured
        return measured is None or measured.is_standing


def source_of(key: str) -> str:
    """Return the source in a key ``.../@cmd/drive/{source}``."""
    return key.rsplit("/", 1)[-1]
