"""The gateway: connects the robot's bus with one node of ROS 2."""

import time
from functools import partial

from common import clock
from common.bus import publisher as bus
from common.freshness import NS_PER_S
from common.service import Node
from common.source import DriveSource
from services.ros2 import fixes, names, translate
from services.ros2.calls import FRESH_NS, Calls
from services.ros2.cdr import Attachment, Value
from services.ros2.command import MAX_PUBLISHERS, SETTLING, SOURCE, Commands, Refusal, Twist
from services.ros2.config import Ros2Config
from services.ros2.endpoints import Endpoints, Publisher, gid
from services.ros2.streams import Streams
from t2 import keys
from t2.messages import Field, Fix, Phrase
from t2.words import render

REPORT_NS = NS_PER_S
TWISTS = {"stamped": "geometry_msgs/msg/TwistStamped", "twist": "geometry_msgs/msg/Twist"}
OTHER_TYPE = Refusal("other_type")
LOG_KEPT = 1000  # lines of /rosout for late subscribers, as of every node


class Gateway:
    """Streams to topics, services to calls, ``cmd_vel`` to drive requests, poses to fixes."""

    def __init__(self, node: Node[Ros2Config]) -> None:
        settings = node.config.ros2
        self._node, self._namespace = node, settings.namespace
        self._commands = Commands(by_zero=settings.neutral == "zero")
        self._diagnostics = translate.Diagnostics()
        self._publishers: dict[bytes, str] = {}  # nodes that publish commands, by GID
        # by publisher or source of fixes: when which decision, the last one last
        self._reported: dict[bytes | str, dict[str, int]] = {}
        ros = names.Node(settings.domain, "", settings.namespace, names.NODE)
        self._ros = Endpoints(node.config.bus, ros, node.loop.post, node.counters)
        self._drive = DriveSource(node.bus, SOURCE)
        self._streams = Streams(node, self._publisher, self._diagnostics)
        Calls(node, self._ros, self._absolute, self._streams.state)
        self._log = self._publisher("/rosout", "rcl_interfaces/msg/Log", kept=LOG_KEPT)
        self._types: list[str] = []  # of the commands that are taken
        for name, interface in TWISTS.items():
            if settings.cmd_vel in ("both", name):
                self._types.append(names.wire_type(interface))
                take = partial(self._take, name == "stamped")
                self._ros.subscribe(self._absolute("cmd_vel"), interface, take, self._unreadable)
        for source, topic in settings.fixes.items():
            take_fix = partial(self._take_fix, source, node.bus.publisher(keys.FIX, source=source))
            unreadable = partial(self._unreadable_fix, source)
            self._ros.subscribe(self._absolute(topic), fixes.POSE, take_fix, unreadable)
        self._ros.watch(self._on_token)
        node.on_exit = self._ros.close
        self._ros.open(lambda: self._commands.listen(clock.now_ns()))

    def _take(self, stamped: bool, about: Attachment, message: Value, received_ns: int) -> None:
        """Pass on a command, or refuse it."""
        twist, now_ns = Twist(*(message[1] if stamped else message)), clock.now_ns()
        state = self._streams.state(now_ns - FRESH_NS)
        decided = self._commands.judge(about, twist, received_ns, now_ns, state)
        if isinstance(decided, Refusal):
            if decided.is_neutral:
                self._drive.request(0.0, 0.0)
            self._refuse(decided, about.gid)
            return
        if decided.neutral_first:
            self._drive.request(0.0, 0.0)
        self._drive.request(decided.linear, decided.angular)
        self._note(translate.OK, Phrase("cmd_vel.taken"), about.gid)

    def _unreadable(self, reason: str) -> None:
        self._refuse(Refusal("unreadable"), b"", reason=reason)

    def _refuse(self, refusal: Refusal, publisher: bytes, **fields: Field) -> None:
        self._node.counters[f"cmd_vel_{refusal.name}"] += 1
        # Each publisher settles when it begins: no reason to warn.
        level = translate.OK if refusal.name == SETTLING.name else translate.WARN
        self._note(level, Phrase(f"cmd_vel.{refusal.name}", fields), publisher)

    def _is_new(self, about: bytes | str, decision: str) -> bool:
        """Return whether it is not the last one; each of a publisher counts once a second."""
        reported, now_ns = self._reported.setdefault(about, {}), clock.now_ns()
        is_repeated = now_ns - reported.get(decision, -REPORT_NS) < REPORT_NS
        if is_repeated or decision == next(reversed(reported), None):
            return False
        reported.pop(decision, None)
        reported[decision] = now_ns
        return True

    def _note(self, level: int, phrase: Phrase, publisher: bytes) -> None:
        """Show a decision in the diagnostics; log a new one, and report a new refusal.

        ``ros2 topic echo`` cuts a text after 128 characters: what to do comes first.
        """
        sender = self._publishers.get(publisher, "unknown")
        decision, text = phrase.name.partition(".")[2], render((phrase,))
        values = {"reason": decision, "publisher": sender}
        self._diagnostics.note(translate.status(level, "cmd_vel", text, values), clock.now_ns())
        known = publisher if publisher in self._publishers else b""  # anybody can invent a GID
        if not self._is_new(known, decision):
            return
        logged = f"{text} ({decision}, cmd_vel of {sender})"
        self._log.put(translate.log(time.time_ns(), level, logged))
        if level == translate.WARN:
            self._node.event("cmd_vel_refused", "warning", phrase, **values)

    def _take_fix(
        self, source: str, to: bus.Publisher[Fix], _: Attachment, message: Value, received_ns: int
    ) -> None:
        """Pass on a pose that a ROS node has measured, or refuse it."""
        decided = fixes.fix(message, self._streams.odometry, received_ns)
        if isinstance(decided, Phrase):
            self._refuse_fix(source, decided)
            return
        to.put(decided)
        self._note_fix(translate.OK, source, Phrase("ros_fix.taken"))

    def _unreadable_fix(self, source: str, reason: str) -> None:
        self._refuse_fix(source, Phrase("ros_fix.unreadable", {"reason": reason}))

    def _refuse_fix(self, source: str, phrase: Phrase) -> None:
        self._node.counters[phrase.name.replace(".", "_")] += 1
        self._note_fix(translate.WARN, source, phrase)

    def _note_fix(self, level: int, source: str, phrase: Phrase) -> None:
        """Log a new decision about a source's poses, and report a new refusal."""
        decision = phrase.name.partition(".")[2]
        if not self._is_new(source, decision):
            return
        logged = f"{render((phrase,))} ({decision}, pose of {source})"
        self._log.put(translate.log(time.time_ns(), level, logged))
        if level == translate.WARN:
            self._node.event("ros_fix_refused", "warning", phrase, reason=decision, source=source)

    def _on_token(self, token: str, appeared: bool) -> None:
        """Keep the nodes that publish commands."""
        node, topic, interface = names.publisher(token) or ("", "", "")
        if topic != self._absolute("cmd_vel"):
            return
        publisher = gid(token)
        if appeared:
            if len(self._publishers) < MAX_PUBLISHERS:
                self._publishers[publisher] = node
            if interface not in self._types:
                self._refuse(OTHER_TYPE, publisher)
            return
        self._publishers.pop(publisher, None)
        self._reported.pop(publisher, None)
        self._commands.gone(publisher)

    def _publisher(self, topic: str, interface: str, *, kept: int = 0) -> Publisher:
        return self._ros.publisher(self._absolute(topic), interface, kept=kept)

    def _absolute(self, name: str) -> str:
        return names.absolute(self._namespace, name)
