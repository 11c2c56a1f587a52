"""The pictures of one robot's cameras: to each browser at the pace and in the size of its link.

A browser asks for the next picture once it shows the last one, and the dashboard asks the camera
then: one picture is on its way, and none waits. The time from sending a picture to that question
decides about the next one's width:

================================= ==================
time                              width
================================= ==================
over ``SLOW_S``                   the next smaller
under ``QUICK_S``, ``QUICK`` times the next larger
================================= ==================
"""

from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass, field

import msgspec

from common import clock
from common.bus.bus import Arrival, Bus
from common.freshness import NS_PER_S, Latest, fresh
from services.dashboard.i18n import Texts, label, rendered
from services.dashboard.telemetry_cache import TelemetryCache
from t2 import keys
from t2.messages import Camera, CameraState, Picture, PictureRequest

WIDTHS = (160, 240, 320, 480, 640, 960, 1920)  # pixels
FIRST = 4  # of WIDTHS, for a new browser
SLOW_S, QUICK_S, QUICK = 0.15, 0.06, 30
CALL_S = 1.0  # for a camera's next picture
CAMERAS_MAX = 8
STATE_S = 3.0  # without a state a camera counts as lost
ANSWERABLE = 16  # pictures of a browser that its holds may answer
AHEAD = 25  # heartbeats: a picture may overtake the state of safety, but not by more
START, END = b"\xff\xd8", b"\xff\xd9"  # of a whole JPEG

Group = tuple[str, int]  # browsers with the same camera and width share a picture


class CameraView(msgspec.Struct, frozen=True):
    """A camera as the page shows it."""

    name: str
    state: CameraState
    text: Texts


class Header(msgspec.Struct, frozen=True):
    """What follows a JPEG to the browser."""

    camera: str
    boot: str  # more digits than JavaScript's numbers have
    seq: int
    heartbeat: int | None
    age: float | None  # s since that heartbeat arrived here; None: it is not known any more


@dataclass
class Stream:
    """The pictures to one browser."""

    camera: str
    level: int = FIRST  # of WIDTHS
    waits: bool = True
    sent_ns: int = 0
    quick: int = 0  # quick pictures in a row
    heartbeats: deque[int] = field(default_factory=lambda: deque(maxlen=ANSWERABLE))

    def shown(self, now_ns: int) -> None:
        """Adapt the width to the time that the last picture took."""
        took_ns = now_ns - self.sent_ns
        self.quick = self.quick + 1 if took_ns < QUICK_S * NS_PER_S else 0
        if took_ns > SLOW_S * NS_PER_S:
            self.level = max(0, self.level - 1)
        elif self.quick >= QUICK:
            self.level, self.quick = min(len(WIDTHS) - 1, self.level + 1), 0


@dataclass
class Last:
    """The newest picture of a group, and whether the camera has been asked for the next one."""

    boot: int = 0
    seq: int = -1
    is_asked: bool = False


class Pictures:
    """The cameras of a robot, and the browsers that show them."""

    def __init__(
        self, bus: Bus, telemetry: TelemetryCache, send: Callable[[Collection[str], bytes], None]
    ) -> None:
        self._bus, self._telemetry, self._send = bus, telemetry, send
        self._cameras: dict[str, Latest[Camera]] = {}
        self._streams: dict[str, Stream] = {}  # by viewer
        self._last: dict[Group, Last] = {}
        bus.subscribe(keys.CAMERA, self._on_state, depth=CAMERAS_MAX, camera="*")

    @property
    def has_camera(self) -> bool:
        """Whether the robot has had a camera since the page was opened."""
        return bool(self._cameras)

    def views(self, now_ns: int) -> tuple[CameraView, ...]:
        """Return the cameras by name."""
        return tuple(self._view(name, now_ns) for name in sorted(self._cameras))

    def watch(self, viewer: str, camera: str, now_ns: int) -> None:
        """Send a browser, which shows its last picture, the next one."""
        stream = self._streams.get(viewer)
        if stream is None or stream.camera != camera:
            self._streams[viewer] = Stream(camera)
        elif not stream.waits:
            stream.shown(now_ns)
            stream.waits = True
        self._ask()

    def leave(self, viewer: str) -> None:
        """Forget a browser."""
        self._streams.pop(viewer, None)

    def has_sent(self, viewer: str, heartbeat: int) -> bool:
        """Return whether a picture with this heartbeat was sent to a browser."""
        stream = self._streams.get(viewer)
        return stream is not None and heartbeat in stream.heartbeats

    def tick(self) -> None:
        """Ask again where a camera did not answer."""
        self._ask()

    def _view(self, name: str, now_ns: int) -> CameraView:
        latest = self._cameras[name]
        if not fresh(latest, now_ns, STATE_S):
            has_robot = self._telemetry.newest(keys.SAFETY, now_ns) is not None
            return CameraView(name, "lost", label("camera_gone" if has_robot else "camera_unknown"))
        it = latest.value
        return CameraView(name, it.state, rendered(it.phrases, it.text))

    def _on_state(self, arrival: Arrival[Camera]) -> None:
        name = arrival.key.split("/")[-2]
        if name in self._cameras or len(self._cameras) < CAMERAS_MAX:
            self._cameras[name] = Latest(arrival.message, arrival.received_ns)

    def _waiting(self) -> dict[Group, list[str]]:
        """Return the browsers that wait, by camera and width."""
        found: dict[Group, list[str]] = {}
        for viewer, stream in self._streams.items():
            if stream.waits and stream.camera in self._cameras:
                found.setdefault((stream.camera, WIDTHS[stream.level]), []).append(viewer)
        return found

    def _ask(self) -> None:
        for group in self._waiting():
            last = self._last.setdefault(group, Last())
            if not last.is_asked:
                last.is_asked = True
                self._call(group, last)

    def _call(self, group: Group, last: Last) -> None:
        def answered(picture: Picture) -> None:
            last.is_asked, last.boot, last.seq = False, picture.boot, picture.seq
            self._pass_on(group, picture)

        def refused(_: object) -> None:
            last.is_asked = False  # the next tick asks again

        request = PictureRequest(camera=group[0], boot=last.boot, seq=last.seq, width=group[1])
        self._bus.call(keys.GET_PICTURE, request, answered, refused, CALL_S)

    def _pass_on(self, group: Group, picture: Picture) -> None:
        viewers = self._waiting().get(group, [])
        if not (picture.jpeg.startswith(START) and picture.jpeg.endswith(END)):
            return  # a later one may be whole
        now_ns = clock.now_ns()
        for viewer in viewers:
            stream = self._streams[viewer]
            stream.waits, stream.sent_ns = False, now_ns
            if picture.heartbeat is not None:
                stream.heartbeats.append(picture.heartbeat)
        if viewers:
            self._send(viewers, self._encoded(group[0], picture, now_ns))

    def _encoded(self, camera: str, picture: Picture, now_ns: int) -> bytes:
        """Return the JPEG, its header, and the header's length in two bytes."""
        age_s = self._age_s(picture, now_ns)
        header = msgspec.json.encode(
            Header(camera, str(picture.boot), picture.seq, picture.heartbeat, age_s)
        )
        return picture.jpeg + header + len(header).to_bytes(2, "big")

    def _age_s(self, picture: Picture, now_ns: int) -> float | None:
        """Return for how long the picture's heartbeat has been known; None without a known one."""
        if picture.heartbeat is None:
            return None
        if shown := self._telemetry.shown(picture.heartbeat):
            return shown.age_s(now_ns)
        newest = self._telemetry.newest(keys.SAFETY, now_ns)
        if newest is None or newest.boot != picture.safety_boot:
            return None
        return 0.0 if 0 < picture.heartbeat - newest.heartbeat <= AHEAD else None
