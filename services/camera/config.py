"""Settings of a camera."""

from typing import Annotated
from urllib.parse import urlsplit

from common import settings
from common.config import masked
from common.settings import allowed
from t2.messages import CameraName

SCHEMES = ("", "rtsp", "rtsps", "http", "https", "tcp", "udp")


class Camera(settings.Section, frozen=True, kw_only=True):
    """Where the pictures come from, and how many are published.

    A password does not belong into ``source``: settings are published on the bus.
    """

    name: CameraName = "front"
    source: str = ""  # /dev/video0, rtsp://HOST/PATH, http://HOST/PATH (MJPEG) or a file
    credentials_file: str = ""  # one line USER:PASSWORD, for the URL of ``source``
    rate: Annotated[float, allowed("Hz", ge=0.5, le=30.0)] = 15.0  # of the pictures, at most
    width: Annotated[int, allowed("pixels", ge=160, le=1920)] = 640  # of the pictures, at most
    quality: Annotated[int, allowed(ge=2, le=31)] = 6  # JPEG's quantizer: 2 is the best
    # from the lens until this service has the picture, of a camera at rest: measure it
    latency: Annotated[float, allowed("s", ge=0.0, le=1.0)] = 0.05

    def __post_init__(self) -> None:
        if masked(f"={self.source}") != f"={self.source}":
            raise ValueError(
                "source contains a user name or password, and settings are published on the bus; "
                "write USER:PASSWORD into a file, and set credentials_file to its path"
            )
        scheme = urlsplit(self.source).scheme
        if scheme not in SCHEMES:
            raise ValueError(
                f"source begins with {scheme}://, allowed are a path and {', '.join(SCHEMES[1:])}"
            )


class CameraConfig(settings.Shared, frozen=True, kw_only=True):
    """The sections that a camera reads."""

    camera: Camera = Camera()
