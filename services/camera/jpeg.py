"""JPEG encoding of pictures in the sizes that are asked for."""

from fractions import Fraction

import av
from av.video.codeccontext import VideoCodecContext

SIZES_MAX = 4  # encoders at once; FFmpeg's keeps the size of its first picture


class JpegEncoder:
    """Encodes pictures; an encoder for each size."""

    def __init__(self, quality: int) -> None:
        self._quality = quality
        self._encoders: dict[tuple[int, int], VideoCodecContext] = {}

    def encode(self, image: av.VideoFrame, width_max: int) -> tuple[bytes, int, int]:
        """Return the JPEG, its width and its height; it is never enlarged."""
        width = max(16, min(width_max, image.width) // 2 * 2)
        height = max(16, round(image.height * width / image.width) // 2 * 2)
        scaled = image.reformat(width=width, height=height, format="yuvj420p")
        scaled.pts = None
        packets = self._encoder(width, height).encode(scaled)
        return b"".join(bytes(packet) for packet in packets), width, height

    def _encoder(self, width: int, height: int) -> VideoCodecContext:
        if (width, height) not in self._encoders:
            if len(self._encoders) >= SIZES_MAX:
                del self._encoders[next(iter(self._encoders))]
            made = av.CodecContext.create("mjpeg", "w")
            assert isinstance(made, VideoCodecContext)
            made.width, made.height, made.pix_fmt = width, height, "yuvj420p"
            made.time_base = Fraction(1, 1000)
            made.thread_count = 1
            made.options = {"qmin": str(self._quality), "qmax": str(self._quality)}
            self._encoders[width, height] = made
        return self._encoders[width, height]
