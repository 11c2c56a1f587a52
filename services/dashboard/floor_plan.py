"""Floor plan behind the trajectory: an image. Two of its points in the map are in the settings."""

from pathlib import Path

from msgspec import Struct

from common.errors import ConfigError
from services.dashboard.config import Dashboard

BYTES_MAX = 10_000_000
# The first bytes of an image, where they are, and its type.
KINDS = (
    (b"\x89PNG\r\n\x1a\n", 0, "image/png"), (b"\xff\xd8\xff", 0, "image/jpeg"),
    (b"WEBP", 8, "image/webp"),
)  # fmt: skip


class FloorPlan(Struct, frozen=True):
    """An image, as it is served."""

    image: bytes
    kind: str


def read(settings: Dashboard) -> FloorPlan | None:
    """Return the plan of the settings, if there is one; raise ``ConfigError`` if it is unusable."""
    if not settings.floor_plan:
        return None
    where = f"dashboard.floor_plan {settings.floor_plan}"
    try:
        image = Path(settings.floor_plan).read_bytes()
    except OSError as error:
        raise ConfigError(f"{where}: cannot be read: {error.strerror}") from None
    kinds = [kind for start, at, kind in KINDS if image[at : at + len(start)] == start]
    if not kinds:
        raise ConfigError(f"{where}: is no PNG, JPEG or WebP: convert it, a PDF or SVG, too")
    if len(image) > BYTES_MAX:
        raise ConfigError(
            f"{where}: has {len(image) / 1e6:.1f} MB, at most {BYTES_MAX / 1e6:g} MB are allowed: "
            "make it smaller, 4000 pixels are enough"
        )
    return FloorPlan(image, kinds[0])
