"""The camera on the bus: pictures out, each with safety's heartbeat of the time when it was taken.

Programs on the robot subscribe to ``tel/camera/NAME/picture``. A program that shows pictures over a
link asks for the next one, ``srv/camera/picture``, once the last one has arrived: no picture waits
behind another, and each has a size that the link takes.
"""

from collections import deque
from typing import NamedTuple

from msgspec.structs import replace

from common import clock
from common.bus.bus import Arrival, Caller
from common.freshness import NS_PER_S, Latest, fresh
from common.heartbeat import Echoes
from common.service import Node
from services.camera.config import CameraConfig
from services.camera.core import WAITED_NS, Lateness, Watch, heartbeat_before, moved
from services.camera.jpeg import JpegEncoder
from services.camera.source import ENDED, SILENT, Frame, Source
from t2 import keys
from t2 import messages as m
from t2.words import render

ECHOES = 64  # queued safety states
WAITING_MAX = 16  # callers that wait for the next picture
CALL_S = 1.0  # until such a caller has given up
LOST_S = 1.0  # without a picture
GAP_S = 0.3  # a longer one between two velocities is no known motion
START_S = 5.0  # for the first picture
EVENTS: dict[m.CameraState, m.EventName] = {
    "up": "camera_up",
    "frozen": "camera_frozen",
    "lost": "camera_lost",
}


class Waiting(NamedTuple):
    """A caller that waits for the next picture."""

    request: m.PictureRequest
    caller: Caller[m.Picture]
    since_ns: int


class CameraService:
    """Connects the source to the bus."""

    def __init__(self, node: Node[CameraConfig]) -> None:
        self._node, self._settings = node, node.config.camera
        self._encoder = JpegEncoder(self._settings.quality)
        self._echoes = Echoes()
        self._velocity: Latest[m.Velocity] | None = None
        self._moved = 0.0  # since the last picture
        self._lateness, self._watch = Lateness(), Watch()
        self._frame: Frame | None = None  # of the last picture
        self._picture: m.Picture | None = None
        self._sizes: dict[int, m.Picture] = {}  # the last picture by width
        self._waiting: deque[Waiting] = deque(maxlen=WAITING_MAX)
        self._pending: deque[Frame] = deque(maxlen=1)  # from the thread of the source
        self._taken_ns, self._taken = clock.now_ns(), 0
        self._error = ""
        self._state: m.CameraState | None = None
        self._reported: m.CameraState | None = None  # at the last report
        self._told: m.CameraState | None = None  # by the last event
        node.counters.update(pictures=0, buffered=0, skipped=0, errors=0)
        bus, name = node.bus, self._settings.name
        self._to_picture = bus.publisher(keys.PICTURE, camera=name)
        self._to_state = bus.publisher(keys.CAMERA, camera=name)
        bus.subscribe(keys.SAFETY, self._on_safety, depth=ECHOES)
        bus.subscribe(keys.VELOCITY, self._on_velocity)
        bus.serve(keys.GET_PICTURE, self._on_call)
        self._source = Source(self._settings, self._on_frame, self._on_error)
        node.loop.every(1.0, self._report)
        node.on_exit = self._source.close
        self._source.open()

    # --- the source's thread ------------------------------------------------------------------

    def _on_frame(self, frame: Frame) -> None:
        if self._pending:
            self._node.counters["skipped"] += 1
        self._pending.append(frame)
        self._node.loop.post(self._take)

    def _on_error(self, reason: str) -> None:
        self._node.loop.post(lambda: self._fail(reason))

    # --- pictures -----------------------------------------------------------------------------

    def _take(self) -> None:
        if not self._pending:
            return
        frame = self._pending.popleft()
        if frame.source_ns is None and frame.waited_ns < WAITED_NS:
            self._node.counters["buffered"] += 1
            return
        jpeg, width, height = self._encoder.encode(frame.image, self._settings.width)
        now_ns = clock.now_ns()
        self._watch = self._watch.seen(jpeg, self._heartbeat(frame), self._moved)
        self._moved = 0.0
        self._frame, self._error, self._taken_ns = frame, "", now_ns
        self._taken += 1
        self._node.counters["pictures"] += 1
        self._picture = self._to_picture.put(
            m.Picture(
                heartbeat=self._watch.heartbeat, safety_boot=self._echoes.boot,
                width=width, height=height, jpeg=jpeg,
            )
        )  # fmt: skip
        self._sizes = {self._settings.width: self._picture}
        self._show("frozen" if self._watch.is_frozen else "up")
        waiting, self._waiting = self._waiting, deque(maxlen=WAITING_MAX)
        for one in waiting:
            self._answer(one.request, one.caller)

    def _heartbeat(self, frame: Frame) -> int | None:
        """Return safety's newest heartbeat of the time when a picture was taken."""
        if self._source.is_file:
            return None
        late_ns = 0
        if frame.source_ns is not None:
            self._lateness = self._lateness.arrived(frame.source_ns, frame.arrived_ns)
            late_ns = self._lateness.late_ns
        taken_ns = frame.arrived_ns - round(self._settings.latency * NS_PER_S) - late_ns
        return heartbeat_before(self._echoes.heartbeat, taken_ns)

    def _on_call(self, request: m.PictureRequest, caller: Caller[m.Picture]) -> None:
        if request.camera != self._settings.name:
            caller.ignore()
        elif self._is_new(request):
            self._answer(request, caller)
        else:
            self._waiting.append(Waiting(request, caller, clock.now_ns()))

    def _is_new(self, request: m.PictureRequest) -> bool:
        it = self._picture
        return it is not None and (it.boot != request.boot or it.seq > request.seq)

    def _answer(self, request: m.PictureRequest, caller: Caller[m.Picture]) -> None:
        caller.reply(self._sized(min(request.width, self._settings.width)))

    def _sized(self, width: int) -> m.Picture:
        assert self._frame is not None
        assert self._picture is not None
        if width not in self._sizes:
            jpeg, *size = self._encoder.encode(self._frame.image, width)
            self._sizes[width] = replace(self._picture, jpeg=jpeg, width=size[0], height=size[1])
        return self._sizes[width]

    # --- state --------------------------------------------------------------------------------

    def _fail(self, reason: str) -> None:
        self._error = reason
        self._node.counters["errors"] += 1
        self._lateness = Lateness()
        self._show("lost")

    def _report(self, now_ns: int) -> None:
        """Publish the state each second; callers that have given up are forgotten."""
        while self._waiting and now_ns - self._waiting[0].since_ns > CALL_S * NS_PER_S:
            self._waiting.popleft()
        rate, self._taken = float(self._taken), 0
        limit_s = LOST_S if self._state else START_S
        if now_ns - self._taken_ns > limit_s * NS_PER_S:
            self._show("lost", rate=rate)
        elif self._state:
            self._show(self._state, rate=rate)
        self._tell()

    def _tell(self) -> None:
        """Publish an event of a state that has lasted since the last report, and no flood."""
        state, before = self._state, self._reported
        self._reported = state
        if state and state == before != self._told:
            self._told = state
            self._node.event(
                EVENTS[state], "info" if state == "up" else "warning", self._phrase(state)
            )

    def _show(self, state: m.CameraState, rate: float | None = None) -> None:
        """Publish the state if it has changed, or with the rate of the last second."""
        is_new, self._state = state != self._state, state
        if not is_new and rate is None:
            return
        phrase = self._phrase(state)
        self._to_state.put(
            m.Camera(
                camera=self._settings.name, state=state, rate=rate or 0.0,
                text=render((phrase,)), phrases=(phrase,),
            )
        )  # fmt: skip

    def _phrase(self, state: m.CameraState) -> m.Phrase:
        camera, it = self._settings.name, self._picture
        if state == "lost":
            if self._error == ENDED:
                return m.Phrase("camera.ended", {"camera": camera})
            if self._error in ("", SILENT):
                return m.Phrase(
                    "camera.silent", {"camera": camera, "source": self._settings.source}
                )
            return m.Phrase("event.camera_lost", {"camera": camera, "reason": self._error})
        fields: dict[str, m.Field] = {"camera": camera}
        if state == "up" and it is not None:
            fields |= {"width": it.width, "height": it.height}
        return m.Phrase(f"event.camera_{state}", fields)

    def _on_safety(self, arrival: Arrival[m.SafetyState]) -> None:
        self._echoes = self._echoes.received(arrival.message, arrival.received_ns)

    def _on_velocity(self, arrival: Arrival[m.Velocity]) -> None:
        before, now_ns = self._velocity, arrival.received_ns
        self._velocity = Latest(arrival.message, now_ns)
        if before is not None and fresh(before, now_ns, GAP_S):
            self._moved += moved(before.value, before.age_s(now_ns))
