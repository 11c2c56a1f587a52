"""The board's own emergency brakes: on and echoed, or the bridge is not ready.

After each return of the board both are requested again, whatever an operator had set before: a
board that restarted has lost them. They are verified once both have echoed "on"; until then they
are requested every 0.1 s, and after the echo timeout the bridge counts as inhibited. From then on
they are sent five times a second, because the wire has no query for them, and at once when the
board returns from a gap of some velocity periods: a board that restarted with its counters near
zero shows nothing else, and its emergency brakes are off. A brake without an echo to five
consecutive sends is no longer known to be on.

A firmware without echoes cannot verify them. Where the settings accept that, the board may be
driven as long as both are commanded on and none has echoed "off".
"""

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.wire.commands import BumperBrakeSet, UltrasonicBrakeSet
from common.wire.frame import Frame

# Half a tick less than 0.1 and 0.2 s: the tick that is due may come early.
ASK_NS = NS_PER_S * 9 // 100
AGAIN_NS = NS_PER_S * 19 // 100
UNECHOED = 5  # consecutive sends (1 s) after which an earlier echo no longer counts
GAP_NS = 60 * NS_PER_S // 1000  # of silence; the velocity comes every 20 ms


class Switches(Struct, frozen=True):
    """Requested positions of both brakes, and the board's last echoes."""

    want_ultrasonic: bool = True
    want_bumper: bool = True
    ultrasonic: bool | None = None
    bumper: bool | None = None
    since_ns: int = 0  # time of the request
    asked_ns: int | None = None
    ultrasonic_sent: int = 0  # since its last echo
    bumper_sent: int = 0

    @property
    def verified(self) -> bool:
        """Whether the board has echoed both as on."""
        return self.ultrasonic is True and self.bumper is True

    @property
    def unechoed(self) -> bool:
        """Whether both are commanded on, and the board has echoed no "off"."""
        wanted = self.want_ultrasonic and self.want_bumper
        return wanted and self.ultrasonic is not False and self.bumper is not False

    @property
    def settled(self) -> bool:
        """Whether the board has echoed the requested positions."""
        return (self.ultrasonic, self.bumper) == (self.want_ultrasonic, self.want_bumper)


def on_return(now_ns: int) -> Switches:
    """Return the initial state: the board is back, or has restarted."""
    return Switches(since_ns=now_ns)


def on_gap(switches: Switches) -> Switches:
    """Send both again at once: the board was silent, and may have restarted meanwhile."""
    return replace(switches, asked_ns=None)


def on_request(
    switches: Switches, ultrasonic: bool | None, bumper: bool | None, now_ns: int
) -> Switches:
    """Request other positions; they take effect with the echo."""
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
    """Return the frames that are due: every 0.1 s until echoed, then every 0.2 s."""
    asked, wait_ns = switches.asked_ns, AGAIN_NS if switches.settled else ASK_NS
    if asked is not None and now_ns - asked < wait_ns:
        return switches, []
    switches = _drop_unechoed(switches)
    frames: list[Frame] = []
    ultrasonic_sent, bumper_sent = switches.ultrasonic_sent, switches.bumper_sent
    if switches.settled or switches.ultrasonic != switches.want_ultrasonic:
        frames.append(UltrasonicBrakeSet(switches.want_ultrasonic))
        ultrasonic_sent += 1
    if switches.settled or switches.bumper != switches.want_bumper:
        frames.append(BumperBrakeSet(switches.want_bumper))
        bumper_sent += 1
    sent = {"ultrasonic_sent": ultrasonic_sent, "bumper_sent": bumper_sent}
    return replace(switches, asked_ns=now_ns, **sent), frames


def _drop_unechoed(switches: Switches) -> Switches:
    """Drop an "on" that is no longer echoed; an "off" lasts until an echo of "on"."""
    ultrasonic, bumper = switches.ultrasonic, switches.bumper
    if ultrasonic is True and switches.ultrasonic_sent >= UNECHOED:
        ultrasonic = None
    if bumper is True and switches.bumper_sent >= UNECHOED:
        bumper = None
    return replace(switches, ultrasonic=ultrasonic, bumper=bumper)


def on_echo(switches: Switches, ultrasonic: bool | None, bumper: bool | None) -> Switches:
    """Process the board's echo of one switch; None for the other."""
    return replace(
        switches,
        ultrasonic=switches.ultrasonic if ultrasonic is None else ultrasonic,
        bumper=switches.bumper if bumper is None else bumper,
        ultrasonic_sent=switches.ultrasonic_sent if ultrasonic is None else 0,
        bumper_sent=switches.bumper_sent if bumper is None else 0,
    )
