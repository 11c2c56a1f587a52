"""Readiness of the board: connected, both its emergency brakes on, and the relay passing. Pure.

**Link.** ``never`` --frame--> ``up`` --silence--> ``lost`` --frame--> ``up``. Configuration is
replayed on each return of the board, motion never is.

**Emergency brakes.** After each return of the board both are requested again, whatever an operator
had set before: a board that restarted has lost them.

=================== ============================================================================
a brake is          it is sent
=================== ============================================================================
not echoed as       every 0.1 s; after the echo timeout the bridge counts as inhibited
wanted
echoed as wanted    every 0.2 s, because the wire has no query for it; without an echo to five
                    consecutive sends it is no longer known to be on
behind a gap of     at once: a board that restarted with its counters near zero shows nothing
60 ms in all frames else, and its emergency brakes are off
=================== ============================================================================

A firmware without echoes cannot verify them. Where the settings accept that, the board may be
driven as long as both are commanded on and none has echoed "off".

**Relay.** It reports from its own UDP port, ``board.relay_port``, which the board cannot use. With
that setting the bridge obeys no RUN while the relay is silent or brakes: a protection that is
configured must be there, and the STOP that the bridge sends meanwhile is the neutral command that
ends the relay's BRAKE.
"""

from collections.abc import Callable
from typing import Annotated

import msgspec

from common.freshness import NS_PER_S
from common.settings import Board
from common.wire.commands import BumperBrakeSet, UltrasonicBrakeSet
from common.wire.frame import Frame
from services.bridge.config import Bridge as Settings
from services.bridge.core.output import Event, Outputs, Publish
from t2 import messages as m
from t2.messages import Few, Field, Name, Phrase, Phrases

# Half a tick less than 0.1 and 0.2 s: the tick that is due may come early.
ASK_NS = NS_PER_S * 9 // 100
AGAIN_NS = NS_PER_S * 19 // 100
UNECHOED = 5  # consecutive sends (1 s) for which an earlier echo counts
GAP_NS = 60 * NS_PER_S // 1000  # of silence; the velocity comes every 20 ms
RELAY_SILENCE_NS = NS_PER_S // 2  # five reports


class Brake:
    """One emergency brake of the board: the position that is wanted, and the one it has echoed."""

    def __init__(self, command: Callable[[bool], Frame]) -> None:
        """Set up with the frame that sets it."""
        self._command = command
        # 2 equivalent mutants: the first frame of the board sets it again.
        self.on_return(0)

    def on_return(self, now_ns: int) -> None:
        """Process the return or the restart of the board: it is wanted on."""
        self.want(True, now_ns)

    def want(self, on: bool, now_ns: int) -> None:
        """Request a position; it takes effect with the echo."""
        self.wanted = on
        self.since_ns = now_ns
        self._echo: bool | None = None
        # 1 equivalent mutant: an echo sets it before it counts.
        self._unechoed = 0  # sends since the last echo
        self.send_at_once()

    def send_at_once(self) -> None:
        """Make it due."""
        self._sent_ns: int | None = None

    def on_echo(self, on: bool) -> None:
        """Process the board's echo."""
        self._echo, self._unechoed = on, 0

    @property
    def position(self) -> bool | None:
        """The last echo; an "on" counts for five sends, an "off" until an "on"."""
        return None if self._echo and self._unechoed > UNECHOED else self._echo

    @property
    def settled(self) -> bool:
        """Whether the board has echoed the requested position."""
        return self.position is self.wanted

    @property
    def assumed_on(self) -> bool:
        """Whether it is commanded on, and the board has echoed no "off"."""
        return self.wanted and self.position is not False

    def due(self, now_ns: int) -> Frame | None:
        """Return its frame if it is due."""
        wait_ns = AGAIN_NS if self.settled else ASK_NS
        if self._sent_ns is not None and now_ns - self._sent_ns < wait_ns:
            return None
        self._sent_ns = now_ns
        self._unechoed += 1
        return self._command(self.wanted)


class Readiness:
    """Tracks link, brakes and relay, and reports their transitions."""

    def __init__(self, settings: Settings, board: Board) -> None:
        self.link: m.LinkState = "never"
        # 2 equivalent mutants: the first frame sets it.
        self.up_ns = 0  # start of the current ``up`` phase
        self.gap_ns = 0  # end of the last short silence (no lost link) of the board
        self.epoch = 0
        self.ultrasonic = Brake(UltrasonicBrakeSet)
        self.bumper = Brake(BumperBrakeSet)
        self.relay = RelayStatus(bool(board.relay_port))
        self._brakes = self.ultrasonic, self.bumper
        # 1 equivalent mutant: the first frame sets it.
        self._received_ns = 0
        self._ports = ", ".join(map(str, board.listen_ports))
        self._silence_ns = round(settings.times.silence * NS_PER_S)
        self._echo_ns = round(settings.times.echo * NS_PER_S)
        self._required = settings.require_switches
        self._published = self.message()
        # 2 equivalent mutants: the first tick sets it.
        self._inhibited = False

    @property
    def ready(self) -> bool:
        """Whether a RUN may reach the board."""
        return self.link == "up" and self._brakes_on and not self.relay.waiting

    @property
    def settled(self) -> bool:
        """Whether the board has echoed the requested position of both brakes."""
        return all(brake.settled for brake in self._brakes)

    @property
    def _brakes_on(self) -> bool:
        if all(brake.position for brake in self._brakes):
            return True
        return not self._required and self._assumed_on

    @property
    def _assumed_on(self) -> bool:
        return all(brake.assumed_on for brake in self._brakes)

    def waiting(self) -> Phrases:
        """Describe the missing condition; empty when ready."""
        if self.link == "never":
            return (Phrase("waiting.board", {"ports": self._ports}),)
        if self.link != "up":
            return (Phrase("waiting.link"),)
        if self.relay.waiting or self._brakes_on:
            return self.relay.waiting
        brakes = Phrase("waiting.brakes")
        if self._required and self._inhibited and self._assumed_on:
            setting = "bridge.require_switches"
            return brakes, Phrase("waiting.no_confirmation", {"setting": setting})
        return (brakes,)

    def on_frame(self, now_ns: int) -> Outputs:
        """Process a valid frame from the board."""
        before, silent_ns = self.link, now_ns - self._received_ns
        self.link, self._received_ns = "up", now_ns
        if before != "up":
            self.up_ns = now_ns
            self._on_return(now_ns)
            yield Event("link_up", "info", {"before": before})
        elif silent_ns > GAP_NS:
            self.gap_ns = now_ns
            for brake in self._brakes:
                brake.send_at_once()

    def unbroken_since(self, since_ns: int) -> bool:
        """Return whether the link has been up since then."""
        return self.link == "up" and self.up_ns <= since_ns

    def was_silent_since(self, since_ns: int, now_ns: int) -> bool:
        """Return whether the board was silent for a moment since then, without a lost link.

        ``now_ns`` is the time of the frame that is being processed: a silence may end with it.
        """
        ends_now = self.link == "up" and now_ns - self._received_ns > GAP_NS
        return ends_now or self.gap_ns > since_ns

    def on_restart(self, now_ns: int) -> Outputs:
        """Process a restart of the board."""
        self.epoch += 1
        self._on_return(now_ns)
        yield Event("board_restarted", "warning", {"epoch": self.epoch})

    def _on_return(self, now_ns: int) -> None:
        for brake in self._brakes:
            brake.on_return(now_ns)

    def on_echo(self, brake: Brake, on: bool) -> Outputs:
        """Process the echo of a brake."""
        brake.on_echo(on)
        yield from self.changes()

    def on_tick(self, now_ns: int) -> Outputs:
        """Detect timeouts."""
        yield from self.relay.on_tick(now_ns)
        if self._is_silent(now_ns):
            self.link = "lost"
            yield Event("link_lost", "error")
        if self.link == "up":
            yield from self._report_inhibited(now_ns)

    def due(self, now_ns: int) -> list[Frame]:
        """Return the frames that set the brakes, if they are due."""
        if self.link != "up":
            return []
        return [frame for brake in self._brakes if (frame := brake.due(now_ns))]

    def changes(self) -> Outputs:
        """Publish the positions of the brakes if they have changed."""
        if self.message() != self._published:
            self._published = self.message()
            yield Publish("switches", self._published)

    def message(self) -> m.Switches:
        """Return the positions of the brakes as the board echoed them."""
        return m.Switches(
            ultrasonic_brake=self.ultrasonic.position, bumper_brake=self.bumper.position
        )

    def _is_silent(self, now_ns: int) -> bool:
        return self.link == "up" and now_ns - self._received_ns > self._silence_ns

    def _report_inhibited(self, now_ns: int) -> Outputs:
        since_ns = max(brake.since_ns for brake in self._brakes)
        inhibited = now_ns - since_ns > self._echo_ns and not self._brakes_on
        if inhibited and not self._inhibited:
            yield Event("switches_unverified", "error")
        self._inhibited = inhibited


class RelayReport(msgspec.Struct, frozen=True):
    """A report, as ``services/relay`` sends it in JSON."""

    version: Name
    braking: Name
    uptime: float
    counters: Annotated[dict[Name, Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]], Few]


class RelayStatus:
    """The newest report, and the transitions of the relay."""

    def __init__(self, required: bool) -> None:
        """Set up; without a configured relay all reports are ignored."""
        self.waiting: Phrases = (Phrase("relay.never"),) if required else ()
        self._required = required
        self._state: m.LinkState = "never"
        self._report = RelayReport("", "", 0.0, {})
        # 2 equivalent mutants: a report sets it.
        self._received_ns = 0
        # 2 equivalent mutants: no event has such a name.
        self._event = ""  # the newest one

    def take(self, datagram: bytes, now_ns: int) -> bool:
        """Process a report; return whether it is valid."""
        try:
            self._report = msgspec.json.decode(datagram, type=RelayReport)
        except (msgspec.DecodeError, RecursionError, UnicodeDecodeError):
            return False
        self._state, self._received_ns = "up", now_ns
        return True

    def on_tick(self, now_ns: int) -> Outputs:
        """Detect a silent relay, and report transitions."""
        if not self._required or self._state == "never":
            return
        if now_ns - self._received_ns > RELAY_SILENCE_NS:
            self._state, self.waiting = "lost", (Phrase("relay.lost"),)
            event = Event("relay_lost", "error")
        elif self._report.braking:
            reason: dict[str, Field] = {"reason": self._report.braking}
            self.waiting = (Phrase("relay.brakes", reason),)
            event = Event("relay_braking", "warning", reason)
        else:
            self.waiting = ()
            event = Event("relay_up", "info")
        if event.name != self._event:
            self._event = event.name
            yield event

    def message(self) -> m.Relay | None:
        """Return state and newest report for the link message; None without a configured relay."""
        if not self._required:
            return None
        report = self._report
        return m.Relay(
            state=self._state, version=report.version, braking=report.braking,
            uptime=report.uptime, counters=report.counters,
        )  # fmt: skip
