"""The camera service at a real stream, on a fake bus."""

import io
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import av
import pytest

from cli.__main__ import main
from common import clock
from common.cli_args import EXIT_CONFIG
from common.errors import ConfigError
from common.freshness import NS_PER_S
from services.camera.camera import CameraService
from services.camera.config import Camera, CameraConfig
from services.camera.source import Source, address, reason
from t2 import keys
from t2 import messages as m
from tests.camera.stream_fixture import StreamServer, stream_server
from tests.factories import safety_state
from tests.fake_bus import FakeNode
from verification.harness.waiting import PATIENCE_S

MS = NS_PER_S // 1000


class Service:
    """The service; its loop runs only while a test waits."""

    def __init__(self, source: str, **settings: Any) -> None:
        config = CameraConfig(camera=Camera(source=source, latency=0.0, **settings))
        self.node = FakeNode("camera", config)
        self.heartbeats: dict[int, int] = {}
        self.service = CameraService(self.node)
        self.number = 0
        self.is_over: Callable[[], object] = lambda: True
        self.node.loop.every(0.02, self._beat)
        self.node.loop.every(0.01, self._check)

    def _check(self, _: int) -> None:
        if self.is_over():
            self.node.loop.stop()

    def _beat(self, now_ns: int) -> None:
        self.number += 1
        self.heartbeats[self.number] = now_ns
        self.node.fake.deliver(keys.SAFETY, safety_state(heartbeat=self.number), now_ns)

    def run_until(self, condition: Callable[[], object], patience_s: float = PATIENCE_S) -> None:
        """Run the loop until a condition holds."""
        end_ns = clock.now_ns() + round(patience_s * NS_PER_S)
        self.is_over = lambda: condition() or clock.now_ns() > end_ns
        self.node.loop.run()
        assert condition()

    def close(self) -> None:
        """End the service."""
        self.node.on_exit()
        self.node.loop.close()

    def run_for(self, seconds: float) -> None:
        """Run the loop for a time."""
        end = time.monotonic() + seconds
        self.run_until(lambda: time.monotonic() > end)

    def picture(self) -> m.Picture:
        """Return the newest picture."""
        count, picture = self.node.sent(keys.PICTURE)
        assert count
        assert isinstance(picture, m.Picture)
        return picture

    @property
    def count(self) -> int:
        return self.node.sent(keys.PICTURE)[0]

    def call(self, **request: Any) -> list[Any]:
        """Call for a picture; return a list that gets the answer."""
        answers: list[Any] = []
        caller: Any = SimpleNamespace(reply=answers.append, ignore=lambda: answers.append(None))
        request = {"camera": "front"} | request
        self.node.fake.served[keys.GET_PICTURE.path](m.PictureRequest(**request), caller)
        return answers


@pytest.fixture
def stream() -> Iterator[StreamServer]:
    with stream_server() as server:
        yield server


@pytest.fixture
def service(stream: StreamServer) -> Iterator[Service]:
    it = Service(stream.source)
    yield it
    it.close()


def luma(jpeg: bytes) -> int:
    """Return the mean luma of a JPEG."""
    with av.open(io.BytesIO(jpeg), "r", format="mjpeg") as container:
        frame = next(container.decode(video=0))
    plane = bytes(frame.reformat(format="gray8").planes[0])
    return round(sum(plane) / len(plane))


def test_pictures_carry_the_newest_heartbeat(service: Service) -> None:
    service.run_until(lambda: service.count > 20)
    it = service.picture()
    assert (it.width, it.height, it.safety_boot) == (64, 36, safety_state().boot)
    assert it.jpeg.startswith(b"\xff\xd8")
    assert it.jpeg.endswith(b"\xff\xd9")
    assert 16 <= luma(it.jpeg) <= 216
    assert it.heartbeat is not None
    age_ns = it.mono_ns - service.heartbeats[it.heartbeat]
    assert 0 <= age_ns < 0.5 * NS_PER_S
    service.run_until(lambda: service.node.events == ["camera_up"])


def test_pictures_that_waited_carry_the_heartbeat_of_their_time(
    service: Service, stream: StreamServer
) -> None:
    service.run_until(lambda: service.count > 10)
    stream.stall_s = 0.6
    stalled_ns = clock.now_ns()

    def is_of_the_stall() -> bool:
        it = service.picture()
        if it.heartbeat is None or it.mono_ns <= stalled_ns:
            return False
        return it.mono_ns - service.heartbeats[it.heartbeat] > 0.2 * NS_PER_S

    service.run_until(is_of_the_stall)


def test_the_same_picture_in_motion_is_frozen(service: Service, stream: StreamServer) -> None:
    service.node.loop.every(
        0.05,
        lambda now_ns: service.node.fake.deliver(
            keys.VELOCITY, m.Velocity(linear=0.3, angular=0.0), now_ns
        ),
    )
    service.run_until(lambda: service.count > 5)
    stream.is_still = True
    service.run_until(lambda: "camera_frozen" in service.node.events)
    heartbeat = service.picture().heartbeat
    service.run_for(0.5)
    assert service.picture().heartbeat == heartbeat
    assert service.node.sent(keys.CAMERA)[1].state == "frozen"
    stream.is_still = False
    service.run_until(lambda: service.node.events[-1:] == ["camera_up"])
    assert service.picture().heartbeat != heartbeat


def test_a_velocity_without_a_next_one_is_no_motion(service: Service, stream: StreamServer) -> None:
    """The router may end in a motion: the vehicle then stops unseen."""
    stream.is_still = True
    service.run_until(lambda: service.count > 5)
    velocity = m.Velocity(linear=0.3, angular=0.0)
    service.node.fake.deliver(keys.VELOCITY, velocity, clock.now_ns())
    service.run_for(0.5)
    heartbeat = service.picture().heartbeat
    service.run_for(0.5)
    assert service.picture().heartbeat != heartbeat


def test_a_stream_that_ends_is_lost_and_comes_back(service: Service, stream: StreamServer) -> None:
    service.run_until(lambda: service.count > 5)
    stream.stall_s = 6.0  # longer than the reader waits, and two reports
    service.run_until(lambda: service.node.events[-1:] == ["camera_lost"])
    state = service.node.sent(keys.CAMERA)[1]
    assert state.state == "lost"
    assert stream.source in state.text
    service.run_until(lambda: service.node.events[-1:] == ["camera_up"])


def test_the_next_picture_is_returned_once_there_is_one(service: Service) -> None:
    early = service.call()
    assert early == []
    service.run_until(lambda: early)
    first = early[0]
    again = service.call(boot=first.boot, seq=first.seq)
    assert again == []
    service.run_until(lambda: again)
    assert again[0].seq > first.seq
    (known,) = service.call()  # of another start: the newest, at once
    assert known.seq >= again[0].seq


def test_a_picture_is_returned_in_the_width_that_was_asked_for(service: Service) -> None:
    service.run_until(lambda: service.count > 2)
    (small,) = service.call(width=32)
    (whole,) = service.call()
    assert (small.width, small.height) == (32, 18)
    assert (whole.width, whole.height) == (64, 36)
    assert small.heartbeat == whole.heartbeat
    assert service.call(camera="rear") == [None]  # that one answers


def test_a_file_is_played_and_drives_nothing(tmp_path: Path, stream: StreamServer) -> None:
    file = tmp_path / "walk.y4m"
    size = 64 * 36
    frames = [b"FRAME\n" + bytes((n * 20,)) * size + bytes((128,)) * (size // 2) for n in range(5)]
    file.write_bytes(b"YUV4MPEG2 W64 H36 F20:1 Ip A1:1 C420jpeg\n" + b"".join(frames))
    it = Service(str(file))
    it.run_until(lambda: it.count > 12)  # again and again
    assert it.picture().heartbeat is None
    it.run_until(lambda: it.node.events == ["camera_up"])
    it.close()


def test_what_is_not_a_stream_is_named(tmp_path: Path) -> None:
    it = Service(str(tmp_path / "missing.mp4"))
    it.run_until(lambda: it.node.events == ["camera_lost"])
    assert "missing.mp4: No such file or directory" in it.node.sent(keys.CAMERA)[1].text
    it.close()


@pytest.mark.parametrize("kind", [av.error.HTTPUnauthorizedError, av.error.InvalidDataError])
def test_a_password_is_not_in_an_error(kind: type[Exception]) -> None:
    error = kind(1, "refused", "http://user:secret@10.0.0.5/stream")
    assert reason(error, "http://10.0.0.5/stream") == "http://10.0.0.5/stream: refused"
    plain = ValueError("http://user:secret@10.0.0.5/stream")
    assert reason(plain, "http://10.0.0.5/stream") == "http://10.0.0.5/stream: ValueError"


def test_a_password_is_not_in_the_settings(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="write USER:PASSWORD into a file"):
        Camera(source="rtsp://user:secret@10.0.0.5/stream")
    file = tmp_path / "camera.txt"
    file.write_text("user:p@ss:word\n")
    given = Camera(source="rtsp://10.0.0.5/stream", credentials_file=str(file))
    assert address(given) == "rtsp://user:p%40ss%3Aword@10.0.0.5/stream"
    with pytest.raises(ConfigError, match="credentials_file: cannot be read"):
        address(Camera(source="rtsp://10.0.0.5/s", credentials_file=str(tmp_path / "none")))
    with pytest.raises(ConfigError, match="t2 camera SOURCE"):
        address(Camera())


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("ftp://10.0.0.5/a", "begins with ftp://, allowed are a path and rtsp, "),
        ("rtsp://anna:secret@10.0.0.5/a", "contains a user name or password"),
        ("rtsp://10.0.0.5/a?user=anna&Password=secret", "contains a user name or password"),
        ("http://10.0.0.5/a?channel=1&access_token=secret", "contains a user name or password"),
        ("anna:secret@10.0.0.5/a", "contains a user name or password"),
        ("rtsp://anna:secret/PWd@10.0.0.5/a", "contains a user name or password"),
        ("http://10.0.0.5/v?usr=a&pwd=secret&loginpas=secret", "contains a user name or password"),
        ("rtsp://10.0.0.5/user=admin_password=secret_channel=1", "contains a user name or passwo"),
        ("http://10.0.0.5/v?auth=secret", "contains a user name or password"),
    ],
)
def test_a_source_that_no_camera_has(
    source: str, reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["camera", source]) == EXIT_CONFIG
    shown = capsys.readouterr().err
    assert reason in shown
    assert "secret" not in shown


@pytest.mark.parametrize("source", ["clips/gate@night.mp4", "http://10.0.0.5/a?keyframe=1&size=2"])
def test_not_each_at_sign_is_a_password(source: str) -> None:
    assert Camera(source=source).source == source


def test_a_folder_is_no_source(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="a folder: name a device or a file"):
        Source(Camera(source=str(tmp_path)), lambda _: None, lambda _: None)
