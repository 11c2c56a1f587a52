"""Localization on the bus: odometry and fixes in, pose in the map out."""

import math

from common import clock
from common.bus.bus import Arrival, Caller
from common.heartbeat import Echoes
from common.pose import Covariance, Pose
from common.service import Node
from services.localization.config import LocalizationConfig
from services.localization.core.estimate import Located
from services.localization.core.fixes import AGREEING
from services.localization.core.localizer import Localizer
from t2 import keys
from t2 import messages as m
from t2.words import done

QUEUED = 16  # messages of a key, until the loop wakes up: a fix may name each odometry
ECHOES = 64  # queued safety states; a call that echoes a dropped one is refused


class LocalizationService:
    """Connects the localizer to the bus; a pose follows each message of odometry."""

    def __init__(self, node: Node[LocalizationConfig]) -> None:
        self._node = node
        self._localizer = Localizer(node.config.localization)
        self._echoes = Echoes()
        self._published: m.MapPose | None = None
        bus = node.bus
        self._to_pose = bus.publisher(keys.MAP_POSE)
        bus.subscribe(keys.ODOMETRY, self._on_odometry, depth=QUEUED)
        for source in node.config.localization.sources:
            bus.subscribe(keys.FIX, self._on_fix, depth=QUEUED, source=source)
        bus.subscribe(keys.SAFETY, self._on_safety, depth=ECHOES, post=node.loop.defer)
        bus.serve(keys.PLACE, self._on_place)

    def _on_odometry(self, arrival: Arrival[m.Odometry]) -> None:
        self._localizer.on_odometry(arrival.message, arrival.received_ns)
        self._publish()

    def _on_fix(self, arrival: Arrival[m.Fix]) -> None:
        source = arrival.key.rpartition("/")[2]
        self._localizer.on_fix(source, arrival.message, arrival.received_ns)

    def _on_safety(self, arrival: Arrival[m.SafetyState]) -> None:
        self._echoes = self._echoes.received(arrival.message, arrival.received_ns)

    def _on_place(self, request: m.PlaceRequest, caller: Caller[m.Done]) -> None:
        now_ns = clock.now_ns()
        if late := self._echoes.refusal(request.echo, now_ns):
            caller.refuse(*late)
            return
        pose = Pose(request.x, request.y, math.remainder(request.heading, math.tau))
        variance, heading = request.sigma**2, request.heading_sigma**2
        certainty = Covariance(variance, 0.0, variance, 0.0, 0.0, heading)
        if reason := self._localizer.place(Located(pose, certainty), now_ns):
            caller.refuse(reason)
            return
        fields: dict[str, m.Field] = {
            "x": pose.x, "y": pose.y, "degrees": math.degrees(pose.heading)
        }  # fmt: skip
        caller.reply(done(m.Phrase("place.done", fields), boot=self._node.bus.boot))
        self._publish()

    def _publish(self) -> None:
        pose = self._localizer.pose(clock.now_ns())
        if pose is None:
            return
        self._report(self._published, pose)
        self._published = self._to_pose.put(pose)

    def _report(self, before: m.MapPose | None, now: m.MapPose) -> None:
        """Publish events of what has changed."""
        if before is None or (before.state, before.placement) != (now.state, now.placement):
            level: m.Level = "info" if now.state == "placed" else "warning"
            self._node.event(now.state, level, *now.phrases)
        counts = {each.source: each.in_a_row for each in before.sources} if before else {}
        for each in now.sources:
            was_refused = counts.get(each.source, 0) >= AGREEING
            if each.in_a_row >= AGREEING and not was_refused:
                count: dict[str, m.Field] = {"source": each.source, "count": each.in_a_row}
                self._node.event(
                    "fixes_refused", "warning", m.Phrase("fix.refused", count), **count
                )
            elif was_refused and each.in_a_row == 0:
                self._node.event("fixes_back", "info", source=each.source)
