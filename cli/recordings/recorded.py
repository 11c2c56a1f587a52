"""Recordings for the commands that read them; what they need is an extra."""

from pathlib import Path
from typing import TYPE_CHECKING

from common.errors import RobotError

if TYPE_CHECKING:
    from services.recorder.reader import Reader


def opened(path: Path) -> "Reader":
    """Open a recording; raise ``RobotError`` when that cannot be."""
    try:
        from services.recorder.reader import Reader
    except ModuleNotFoundError as error:
        raise RobotError(
            f"recordings need {error.name}: install the extra `record` (pip install -e '.[record]')"
        ) from None
    return Reader(path)
