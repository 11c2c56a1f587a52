"""Services of ROS 2 as calls of the bus: emergency stop and reset; the node's parameters.

A reset that the network held back must not clear a stop that its sender cannot have seen. The
attachment has the sender's clock, and a client that calls once has no fastest delivery to compare
with, as ``command`` does. So the clocks of robot and client must agree as far as the stop is old.
"""

import math
import time
from collections.abc import Callable
from functools import partial

from common import clock
from common.freshness import NS_PER_S
from common.service import Node
from services.ros2 import names, parameters
from services.ros2.cdr import Attachment, Value
from services.ros2.config import Ros2Config
from services.ros2.endpoints import Answer, Endpoints
from t2 import keys
from t2 import messages as m
from t2.client import ResetCheck, reset_request

CONFIRM_NS, REPEAT_S = 3 * NS_PER_S, 0.05
FRESH_NS = NS_PER_S // 2  # age of safety's state; older, and safety counts as silent
CALLS_MAX = 32  # stops that wait, and resets
TOLERANCE_S = 0.2  # of the two clocks, and of the age of safety's state
TRIGGER = "std_srvs/srv/Trigger"
IN_ROS = {
    "reset.done": "Reset. Stop publishing for 0.5 s, then publish again.",
    "reset.motion": "Motion is requested, by a node or another source: stop publishing for 0.5 s.",
}


class Calls:
    """Serves the robot's services; every one is answered, as ROS clients wait without a limit."""

    def __init__(
        self,
        node: Node[Ros2Config],
        ros: Endpoints,
        absolute: Callable[[str], str],
        state: Callable[[int], m.SafetyState | None],
    ) -> None:
        self._node, self._state = node, state
        self._stops: list[tuple[Answer, int]] = []  # answers that wait, and since when
        self._resets: list[tuple[Answer, ResetCheck, str]] = []  # with the text of success
        ros.serve(absolute("hardware/e_stop_trigger"), TRIGGER, self._stop)
        ros.serve(absolute("hardware/e_stop_reset"), TRIGGER, self._reset)
        for name, (interface, respond) in parameters.SERVICES.items():
            take = partial(self._parameters, respond)
            ros.serve(absolute(f"{names.NODE}/{name}"), interface, take)
        node.loop.every(REPEAT_S, self._confirm)

    def _stop(self, _: Attachment, __: Value, answer: Answer) -> None:
        """Stop the robot, and answer when safety's state shows it."""
        if len(self._stops) == CALLS_MAX:
            answer((False, "Too many calls wait for their stop."))
            return
        self._node.bus.estop()
        self._stops.append((answer, clock.now_ns()))

    def _confirm(self, now_ns: int) -> None:
        """Answer what safety's state confirms; repeat an emergency stop until then."""
        newest, resets = self._state(now_ns - FRESH_NS), self._resets
        self._resets = []
        for reset in resets:
            answer, check, text = reset
            outcome = check.outcome(newest, now_ns)
            if outcome is None:
                self._resets.append(reset)
            else:
                answer((outcome, text if outcome else "Safety's state does not confirm it."))
        waiting = []
        for answer, since_ns in self._stops:
            state = self._state(since_ns)  # an older one may show an earlier stop
            if state is not None and "estop" in state.latched:
                answer((True, "Stopped and latched."))
            elif now_ns - since_ns > CONFIRM_NS:
                answer((False, "Sent, but safety does not confirm it. Use the vehicle's switch."))
            else:
                waiting.append((answer, since_ns))
        self._stops = waiting
        if waiting:
            self._node.bus.estop()

    def _reset(self, about: Attachment, _: Value, answer: Answer) -> None:
        """Clear what is latched now, unless it is newer than the request."""
        state = self._state(clock.now_ns() - FRESH_NS)
        if state is None or len(self._resets) == CALLS_MAX:
            answer((False, "Too many resets wait." if state else "Safety is silent."))
            return
        if reason := reset_refusal(state, about.source_ns, time.time_ns()):
            answer((False, reason))
            return
        check = ResetCheck(state)

        def answered(done: m.ResetDone) -> None:
            check.answer(done)
            self._resets.append((answer, check, in_ros(done)))

        self._node.bus.call(
            keys.RESET,
            reset_request(state),
            answered,
            lambda refused: answer((False, in_ros(refused))),
        )

    def _parameters(
        self, respond: parameters.Respond, _: Attachment, request: Value, answer: Answer
    ) -> None:
        state = self._state(clock.now_ns() - FRESH_NS)
        known = parameters.parameters(self._node.config, state.limits if state else None)
        answer(respond(known, *(request or ())))


def in_ros(answer: m.Done | m.Refusal) -> str:
    """Return safety's text for a ROS node, which has no controls to let go of."""
    return IN_ROS.get(answer.phrases[0].name, answer.text) if answer.phrases else answer.text


def reset_refusal(state: m.SafetyState, sent_ns: int, now_ns: int) -> str:
    """Return why a reset must not clear what this state has latched; empty when it may.

    ``sent_ns`` and ``now_ns`` are the wall clocks of the sender and of the robot.
    """
    age_s = (now_ns - sent_ns) / NS_PER_S
    latched_s = min(
        (cause.age for cause in state.causes if cause.name in state.latched), default=math.inf
    )
    if age_s < -TOLERANCE_S:
        return f"The sender's clock is {-age_s:.1f} s ahead of the robot's. Synchronize the clocks."
    if max(age_s, 0.0) + TOLERANCE_S <= latched_s:
        return ""
    return (
        f"The reset was sent {age_s:.1f} s ago by its sender's clock, and the last stop was "
        f"{latched_s:.1f} s ago. Reset again; if that fails, synchronize the clocks."
    )
