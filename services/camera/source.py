"""The source of pictures: device, network camera or file; a thread reads it.

It is opened again after each error. A file is played at its own speed, again and again.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote, urlsplit

import av
from av.container import InputContainer
from av.video.stream import VideoStream

from common import clock
from common.errors import ConfigError
from common.freshness import NS_PER_S
from services.camera.config import Camera

OPEN_S, READ_S = 5.0, 2.0  # time limits of a network camera
RETRY_S = 1.0
ENDED, SILENT = "the stream has ended", "no picture arrives"
EARLY = 0.25  # of a period: a picture that is due so soon is taken
# Options of FFmpeg by the beginning of the source: without its own buffers.
OPTIONS = {
    "rtsp": {"rtsp_transport": "tcp", "fflags": "nobuffer", "max_delay": "0"},
    "http": {"fflags": "nobuffer"},
    "tcp": {"fflags": "nobuffer", "tcp_nodelay": "1"},
}
UNTIMED = ("http", "https")  # MJPEG has no times: FFmpeg invents them


class Frame(NamedTuple):
    """A decoded picture and its times."""

    image: av.VideoFrame
    arrived_ns: int
    source_ns: int | None  # by the source's clock; None: it has none
    waited_ns: int  # for it


class Source:
    """Reads pictures in a thread; the newest one is passed on, at most ``rate`` a second."""

    def __init__(
        self, settings: Camera, on_frame: Callable[[Frame], None], on_error: Callable[[str], None]
    ) -> None:
        """Both handlers are called in the thread."""
        if settings.source and Path(settings.source).is_dir():
            raise ConfigError(f"camera.source {settings.source}: a folder: name a device or a file")
        self.is_file = Path(settings.source).is_file()
        self._settings = settings
        self._address = address(settings)
        self._on_frame, self._on_error = on_frame, on_error
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)

    def open(self) -> None:
        """Start reading."""
        self._thread.start()

    def close(self) -> None:
        """Stop reading; does not wait for a device that hangs."""
        self._closing.set()

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                with closing(self._opened()) as container:
                    for frame in self._frames(container):
                        self._on_frame(frame)
                    if not self.is_file:
                        self._on_error(ENDED)
            except (av.FFmpegError, OSError, ValueError, IndexError) as error:
                self._on_error(reason(error, self._settings.source))
            if not self.is_file:
                self._closing.wait(RETRY_S)

    def _opened(self) -> InputContainer:
        source = self._settings.source
        form = "v4l2" if source.startswith("/dev/") else None
        options = dict(OPTIONS.get(urlsplit(source).scheme, {}))
        return av.open(self._address, format=form, options=options, timeout=(OPEN_S, READ_S))

    def _frames(self, container: InputContainer) -> Iterator[Frame]:
        stream = container.streams.video[0]
        stream.codec_context.thread_count = 1  # threads would delay pictures
        period_ns, due_ns = round(NS_PER_S / self._settings.rate), 0
        started_ns = asked_ns = clock.now_ns()
        for packet in container.demux(stream):
            arrived_ns = clock.now_ns()
            for image in packet.decode():
                source_ns = self._time(stream, image)
                if self.is_file and source_ns is not None:
                    self._closing.wait((started_ns + source_ns - arrived_ns) / NS_PER_S)
                    arrived_ns = clock.now_ns()
                if self._closing.is_set():
                    return
                if arrived_ns >= due_ns - period_ns * EARLY:
                    due_ns = max(due_ns + period_ns, arrived_ns)
                    yield Frame(image, arrived_ns, source_ns, arrived_ns - asked_ns)
            asked_ns = clock.now_ns()

    def _time(self, stream: VideoStream, image: av.VideoFrame) -> int | None:
        is_untimed = urlsplit(self._settings.source).scheme in UNTIMED
        if is_untimed or image.pts is None or stream.time_base is None:
            return None
        return round(image.pts * stream.time_base * NS_PER_S)


def address(settings: Camera) -> str:
    """Return the source with user and password; raise ``ConfigError`` without a source."""
    if not settings.source:
        raise ConfigError(
            "camera.source is empty: set it, or run `t2 camera SOURCE` with /dev/video0, "
            "rtsp://HOST/PATH, http://HOST/PATH or a file"
        )
    if not settings.credentials_file:
        return settings.source
    try:
        user, _, password = (
            Path(settings.credentials_file).read_text(encoding="utf-8").strip().partition(":")
        )
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"camera.credentials_file: cannot be read: {error}") from None
    parts = urlsplit(settings.source)
    return parts._replace(netloc=f"{quote(user)}:{quote(password)}@{parts.netloc}").geturl()


def reason(error: Exception, source: str) -> str:
    """Return why a source cannot be read; the text of an error may contain its password."""
    if isinstance(error, av.error.ExitError):  # the time limit
        return SILENT
    text = getattr(error, "strerror", None) or type(error).__name__
    return f"{source}: {text}"
