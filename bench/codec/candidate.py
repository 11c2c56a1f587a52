"""One way to make bytes of values and values of bytes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Candidate:
    """A codec under test; each mapping is by the name of a frame or message.

    ``encode`` makes bytes of plain values, with the library's object in between where it wants one.
    ``decode`` makes the library's object of bytes, or raises. ``plain`` makes the plain values
    of that object, or raises where it stands for a refusal; it is not timed.
    """

    name: str
    encode: Mapping[str, Callable[[Any], bytes]]
    decode: Mapping[str, Callable[[bytes], Any]]
    plain: Callable[[str, Any], Any]
    calls: int = 100  # in a sample; fewer of what takes far longer than the others

    def there_and_back(self, name: str, value: Any) -> Any:
        """Return what comes out of it for a value that goes in."""
        return self.plain(name, self.decode[name](self.encode[name](value)))

    def refuses(self, name: str, raw: bytes) -> bool:
        """Tell whether it refuses these bytes, however it says so."""
        try:
            self.plain(name, self.decode[name](raw))
        except Exception:
            return True
        return False


def writers(
    velocity: Callable[[Any], bytes],
    motion: Callable[[Any], bytes],
    bumper: Callable[[Any], bytes],
    ultrasonic: Callable[[Any], bytes],
) -> Mapping[str, Callable[[Any], bytes]]:
    """Return who makes which frame."""
    return {
        "velocity report": velocity,
        "run command": motion,
        "bumper report": bumper,
        "ultrasonic report": ultrasonic,
    }


def readers(board: Callable[[bytes], Any], robot: Callable[[bytes], Any]) -> Mapping[str, Any]:
    """Return who reads which frame: what the board sends, and what the robot's computer sends."""
    return {
        "velocity report": board,
        "run command": robot,
        "bumper report": board,
        "ultrasonic report": board,
    }
