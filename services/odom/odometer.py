"""Odometry on the bus: counters and velocities in, pose and twist out.

An estimate follows each counter sample; while counters are missing, each check.
Zenoh sends nothing to the router without a subscriber.
"""

from common import clock
from common.bus.bus import Arrival, Caller
from common.freshness import NS_PER_S
from common.heartbeat import Echoes
from common.pose import Pose
from common.service import Node
from services.odom.config import OdomConfig
from services.odom.core.estimator import Estimator
from t2 import keys
from t2 import messages as m
from t2.words import done

SILENT_NS = NS_PER_S // 2  # without input, until the event; shorter gaps show as missing samples
CHECK_S = 0.1  # between two checks for that, and for counters
NO_COUNTERS_NS = NS_PER_S // 10  # until an estimate follows each check
VELOCITIES = 16  # queued until the loop wakes up
ECHOES = 64  # queued safety states; a call that echoes a dropped one is refused


class Odometer:
    """Connects the estimator to the bus."""

    def __init__(self, node: Node[OdomConfig]) -> None:
        self._node = node
        self._estimator = Estimator(node.config.odom)
        self._counted_ns = 0  # the newest counter sample
        self._estimated_ns = 0
        self._silent = True  # no input yet
        self._slip = False
        self._echoes = Echoes()
        bus = node.bus
        self._to_odometry = bus.publisher(keys.ODOMETRY)
        defer = node.loop.defer
        bus.subscribe(keys.VELOCITY, self._on_velocity, depth=VELOCITIES, post=defer)
        bus.subscribe(keys.MILEAGE, self._on_mileage)
        bus.subscribe(keys.SAFETY, self._on_safety, depth=ECHOES, post=defer)
        bus.serve(keys.SET_POSE, self._on_set_pose)
        node.loop.every(CHECK_S, self._check)

    def _on_velocity(self, arrival: Arrival[m.Velocity]) -> None:
        self._estimator.on_velocity(arrival.message, arrival.received_ns)

    def _on_mileage(self, arrival: Arrival[m.Mileage]) -> None:
        self._counted_ns = arrival.received_ns
        if self._estimator.on_mileage(arrival.message, arrival.received_ns):
            self._node.event("reanchored", "warning")
        self._estimate()

    def _on_safety(self, arrival: Arrival[m.SafetyState]) -> None:
        self._echoes = self._echoes.received(arrival.message, arrival.received_ns)

    def _on_set_pose(self, request: m.PoseRequest, caller: Caller[m.Done]) -> None:
        late = self._echoes.refusal(request.echo, clock.now_ns())
        if late:
            caller.refuse(*late)
            return
        pose = Pose(request.x, request.y, request.heading)
        self._estimator.place(pose, clock.now_ns())
        fields: dict[str, m.Field] = {"x": request.x, "y": request.y, "heading": request.heading}
        phrase = m.Phrase("pose.set", fields)
        self._node.event("pose_set", "info", phrase, epoch=self._estimator.epoch)
        caller.reply(done(phrase, boot=self._node.bus.boot))

    def _estimate(self) -> None:
        now_ns = clock.now_ns()
        odometry = self._estimator.estimate(now_ns)
        if odometry is None:
            return
        self._estimated_ns = now_ns
        self._to_odometry.put(odometry)
        if self._silent:
            self._silent = False
            self._node.event("velocity_back", "info")
        self._report_slip(odometry)

    def _check(self, now_ns: int) -> None:
        if now_ns - self._counted_ns > NO_COUNTERS_NS:
            self._estimate()
        if self._silent or now_ns - self._estimated_ns < SILENT_NS:
            return
        self._silent = True
        self._node.event("silent", "warning")

    def _report_slip(self, odometry: m.Odometry) -> None:
        if odometry.slip and not self._slip:
            self._node.event("slip", "warning", residual=odometry.residual)
        elif self._slip and not odometry.slip:
            self._node.event("slip_over", "info")
        self._slip = odometry.slip
