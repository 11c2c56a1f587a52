"""The board's own emergency brakes: on and echoed, or the bridge is not ready.

After each return of the board both are asked for again, whatever an operator had set before: a
board that restarted has forgotten. They are verified once both have echoed "on"; until then they
are asked for every tenth of a second, and after the echo timeout the bridge counts as inhibited.
From then on they are asked for once a second, because the wire has no query for them.
"""

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import S
from common.wire.commands import BumperBrakeSet, UltrasonicBrakeSet
from common.wire.frame import Frame

ASK_NS = S // 10
AGAIN_NS = S  # a board that restarted between two frames has forgotten, and nothing else tells


class Switches(Struct, frozen=True):
    """What is wanted of the two brakes, and what the board echoed last."""

    want_ultrasonic: bool = True
    want_bumper: bool = True
    ultrasonic: bool | None = None
    bumper: bool | None = None
    since_ns: int = 0  # when they were wanted first
    asked_ns: int | None = None

    @property
    def verified(self) -> bool:
        """Whether both are on, by the board's own word."""
        return self.ultrasonic is True and self.bumper is True

    @property
    def settled(self) -> bool:
        """Whether the board has echoed what is wanted."""
        return (self.ultrasonic, self.bumper) == (self.want_ultrasonic, self.want_bumper)


def on_return(now_ns: int) -> Switches:
    """Begin anew: the board is back, or has restarted."""
    return Switches(since_ns=now_ns)


def on_request(
    switches: Switches, ultrasonic: bool | None, bumper: bool | None, now_ns: int
) -> Switches:
    """Want other positions; the echo decides when they count."""
    return replace(
        switches,
        want_ultrasonic=switches.want_ultrasonic if ultrasonic is None else ultrasonic,
        want_bumper=switches.want_bumper if bumper is None else bumper,
        ultrasonic=switches.ultrasonic if ultrasonic is None else None,
        bumper=switches.bumper if bumper is None else None,
        since_ns=now_ns,
        asked_ns=None,
    )


def on_tick(switches: Switches, now_ns: int) -> tuple[Switches, list[Frame]]:
    """Return the frames that are due: often until the board has echoed, then now and again."""
    asked, wait_ns = switches.asked_ns, AGAIN_NS if switches.settled else ASK_NS
    if asked is not None and now_ns - asked < wait_ns:
        return switches, []
    frames: list[Frame] = []
    if switches.settled or switches.ultrasonic != switches.want_ultrasonic:
        frames.append(UltrasonicBrakeSet(switches.want_ultrasonic))
    if switches.settled or switches.bumper != switches.want_bumper:
        frames.append(BumperBrakeSet(switches.want_bumper))
    return replace(switches, asked_ns=now_ns), frames


def on_echo(switches: Switches, ultrasonic: bool | None, bumper: bool | None) -> Switches:
    """Take in the board's echo of one switch; None for the other."""
    return replace(
        switches,
        ultrasonic=switches.ultrasonic if ultrasonic is None else ultrasonic,
        bumper=switches.bumper if bumper is None else bumper,
    )
