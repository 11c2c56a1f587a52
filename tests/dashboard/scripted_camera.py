"""A camera whose pictures a test freezes, delays, reorders, cuts off or damages."""

from collections import deque
from collections.abc import Callable

import av
from msgspec.structs import replace

from common import clock
from common.bus.bus import Arrival, Bus, Caller
from common.freshness import NS_PER_S
from common.loop import Loop
from services.camera.jpeg import JpegEncoder
from t2 import keys
from t2 import messages as m

RATE_HZ = 20.0
Damage = Callable[[bytes], bytes]


class ScriptedCamera:
    """Takes 20 pictures a second; ``mode`` decides what is done with them."""

    def __init__(self, loop: Loop) -> None:
        self.mode = "normal"  # or "frozen", "cut", "reordered"
        self.delay_s = 0.0
        self.damage: Damage = lambda jpeg: jpeg
        self.received_ns: dict[int, int] = {}  # when each heartbeat of safety came here
        self._loop, self._heartbeat = loop, 0
        self._encoder, self._number = JpegEncoder(6), 0
        self._taken: deque[tuple[int, m.Picture]] = deque(maxlen=400)  # with the time
        self._waiting: list[tuple[m.PictureRequest, Caller[m.Picture]]] = []

    def declare(self, bus: Bus) -> None:
        """Declare the camera; its timers run in the loop."""
        self._bus = bus
        self._state = bus.publisher(keys.CAMERA, camera="front")
        bus.subscribe(keys.SAFETY, self._on_safety)
        bus.serve(keys.GET_PICTURE, lambda request, caller: self._waiting.append((request, caller)))
        self._loop.post(self._start)

    def _start(self) -> None:
        self._loop.every(1 / RATE_HZ, self._tick)
        self._loop.every(0.005, lambda _: self._bus.answer_queries())
        self._loop.every(0.5, lambda _: self._show())

    def _on_safety(self, arrival: Arrival[m.SafetyState]) -> None:
        self._heartbeat = arrival.message.heartbeat
        self.received_ns[self._heartbeat] = arrival.received_ns

    def _show(self) -> None:
        if self.mode != "cut":
            self._state.put(m.Camera(camera="front", state="up", rate=RATE_HZ, text="up"))

    def _tick(self, now_ns: int) -> None:
        if self.mode != "frozen":
            self._taken.append((now_ns, self._take()))
        if self.mode != "cut":
            waiting, self._waiting = self._waiting, []
            for request, caller in waiting:
                self._answer(request, caller)

    def _take(self) -> m.Picture:
        image = av.VideoFrame(320, 180, "gray8")
        row = bytes((self._number * 8 + at) % 256 for at in range(image.planes[0].line_size))
        image.planes[0].update(row * 180)
        jpeg, width, height = self._encoder.encode(image, 320)
        self._number += 1
        return m.Picture(
            boot=self._bus.boot, seq=self._number, heartbeat=self._heartbeat,
            width=width, height=height, jpeg=jpeg,
        )  # fmt: skip

    def _answer(self, request: m.PictureRequest, caller: Caller[m.Picture]) -> None:
        until_ns = clock.now_ns() - round(self.delay_s * NS_PER_S)
        ready = [picture for at_ns, picture in self._taken if at_ns <= until_ns]
        if not ready:
            self._waiting.append((request, caller))
            return
        newest = ready[-1]
        if self.mode == "reordered":  # every other answer is an older one
            newest = ready[-1 - 10 * (self._number % 2)] if len(ready) > 10 else newest
        elif newest.boot == request.boot and newest.seq <= request.seq:
            self._waiting.append((request, caller))
            return
        caller.reply(_with(newest, self.damage(newest.jpeg)))


def _with(picture: m.Picture, jpeg: bytes) -> m.Picture:
    return replace(picture, jpeg=jpeg)
