"""ROS nodes that publish ``cmd_vel`` as their tools do, and the gateway's decisions about them."""

from typing import Any

from common.freshness import NS_PER_S
from services.ros2.cdr import Attachment
from services.ros2.command import BEGINS, SETTLES, SOURCE, Commands, Request, Twist
from t2 import keys
from t2 import messages as m
from verification.search.bus import Process, Source

TICKS = 60  # of 50 ms, until a pattern repeats
PATTERNS = {
    "topic_pub": range(TICKS),
    "keyboard": (0, *range(10, 35)),  # a held key, and its repeats
    "planner": range(32),  # a goal, then a pause
}  # the ticks at which a node publishes
PAUSE_NS = NS_PER_S // 2  # from the safety case
TRANSIENT = {"blocked", "no_request", "neutral"}  # they end without a neutral request
SETTLE_NS = NS_PER_S // 2  # likewise: how long a pause may be followed by neutral requests


class RosSource(Source):
    """One node at a time; reports a neutral request that no pause of the node explains."""

    def __init__(self, process: Process, violations: list[str]) -> None:
        super().__init__(SOURCE, keys.DRIVE, process)
        self._violations = violations
        self._commands = Commands()
        self._commands.listen(0)
        self._pattern: Any = ()
        self._twist = Twist((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self._nodes = self._sent = self._ticks = self._unheard = 0
        self._moved_ns = 0  # when the node last published
        self._paused_ns = 0  # when its newest pause ended
        self._state: m.SafetyState | None = None
        process.subscribe(keys.SAFETY, self._on_state)

    def start(self, pattern: str | None, linear: float, unheard: int = 0) -> None:
        """Replace the node by a new one of this pattern; None: by no node.

        ``unheard`` is the number of ticks after which its link to the gateway is up.
        """
        self._pattern = PATTERNS[pattern] if pattern else ()
        self._twist = Twist((linear, 0.0, 0.0), (0.0, 0.0, 0.0))
        self._nodes, self._unheard = self._nodes + 1, unheard
        self._sent = self._ticks = self._moved_ns = 0

    def publish(self) -> None:
        """Publish a command of the node, if this is the time, through the gateway."""
        tick, self._ticks = self._ticks % TICKS, self._ticks + 1
        if tick not in self._pattern:
            return
        now_ns, moved_ns = self.process.net.now_ns, self._moved_ns
        self._sent, self._moved_ns = self._sent + 1, now_ns
        if self._ticks <= self._unheard:
            return
        about = Attachment(self._sent, now_ns, self._nodes.to_bytes(16, "big"))
        decided = self._commands.judge(about, self._twist, now_ns, now_ns, self._state)
        if now_ns - moved_ns >= PAUSE_NS:
            self._paused_ns = now_ns
        if decided in (BEGINS, SETTLES):
            self._put_neutral(now_ns)
        elif isinstance(decided, Request):
            if decided.neutral_first:
                self._put_neutral(now_ns)
            self.put(m.Drive(linear=decided.linear, angular=decided.angular, echo=self.echo))

    def _put_neutral(self, now_ns: int) -> None:
        if now_ns - self._paused_ns > SETTLE_NS:
            self._violations.append("a neutral request without a pause of the ROS node")
        self.put(m.Drive(linear=0.0, angular=0.0, echo=self.echo))

    def _on_state(self, arrival: Any) -> None:
        self._state = arrival.message
        stops = {cause.name for cause in arrival.message.causes if cause.action != "slow"}
        if stops - TRANSIENT:
            self._paused_ns = 0  # motion is barred: a new pause is due
