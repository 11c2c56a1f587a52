"""Readiness of the board for a RUN: connected, both emergency brakes on, the relay passing. Pure.

``never`` --frame--> ``up`` --silence--> ``lost`` --frame--> ``up``. Configuration is replayed on
each return of the board, motion never is.
"""

from common.freshness import NS_PER_S
from common.settings import Board
from common.wire.commands import BumperBrakeSet, UltrasonicBrakeSet
from common.wire.frame import Frame
from services.bridge.config import TimeLimits
from services.bridge.core.brakes import Brake
from services.bridge.core.output import Event, Outputs, Publish
from services.bridge.core.relay_status import RelayStatus
from t2 import messages as m
from t2.messages import Phrase, Phrases

GAP_NS = 60 * NS_PER_S // 1000  # of silence; the velocity comes every 20 ms


class Readiness:
    """Tracks link, brakes and relay, and reports their transitions."""

    def __init__(self, times: TimeLimits, board: Board) -> None:
        self.link: m.LinkState = "never"
        self.up_ns = 0  # start of the current ``up`` phase
        self.gap_ns = 0  # end of the last short silence (no lost link) of the board
        self.epoch = 0
        self.ultrasonic = Brake(UltrasonicBrakeSet)
        self.bumper = Brake(BumperBrakeSet)
        self.relay = RelayStatus(bool(board.relay_port))
        self._brakes = self.ultrasonic, self.bumper
        self._received_ns = 0
        self._ports = ", ".join(map(str, board.listen_ports))
        self._silence_ns = round(times.silence * NS_PER_S)
        self._confirmation_ns = round(times.confirmation * NS_PER_S)
        self._required = board.require_switches
        self._published = self.message()
        self._inhibited = False

    @property
    def ready(self) -> bool:
        """Whether a RUN may reach the board."""
        return self.link == "up" and self._brakes_on and not self.relay.waiting

    @property
    def settled(self) -> bool:
        """Whether the board has confirmed the requested position of both brakes."""
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
            setting = "board.require_switches"
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

    def on_confirmation(self, brake: Brake, on: bool) -> Outputs:
        """Process the confirmation of a brake."""
        brake.on_confirmation(on)
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
        """Return the positions of the brakes as the board confirmed them."""
        return m.Switches(
            ultrasonic_brake=self.ultrasonic.position, bumper_brake=self.bumper.position
        )

    def _is_silent(self, now_ns: int) -> bool:
        return self.link == "up" and now_ns - self._received_ns > self._silence_ns

    def _report_inhibited(self, now_ns: int) -> Outputs:
        since_ns = max(brake.since_ns for brake in self._brakes)
        inhibited = now_ns - since_ns > self._confirmation_ns and not self._brakes_on
        if inhibited and not self._inhibited:
            yield Event("switches_unverified", "error")
        self._inhibited = inhibited
