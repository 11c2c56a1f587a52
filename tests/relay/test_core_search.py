"""Random events: no RUN passes without its conditions, and a neutral command always ends BRAKE."""

from hypothesis import given, settings
from hypothesis import strategies as st

from services.relay import wire
from services.relay.core import BOARD, BRAKE_PERIOD_NS, LEASE_NS, PC, Relay
from tests.relay.frames import CLEAR, HIT, QUERY, RUN, STOP, ZERO

MS = 1_000_000
NOW = 1_000_000 * MS
TICK_NS = 5 * MS
FROM_PC = [RUN, STOP, ZERO, wire.BRAKE, QUERY, RUN[:-1], STOP + RUN, b"", QUERY + STOP, RUN + STOP]
MOVING = {RUN, STOP + RUN, RUN + STOP}
NEUTRAL = {STOP, ZERO, wire.BRAKE, QUERY + STOP}
EVENTS = st.one_of(
    st.tuples(st.just("pc"), st.sampled_from(FROM_PC), st.integers(0, 1), st.integers(0, 250)),
    st.tuples(st.just("board"), st.sampled_from([HIT, CLEAR, HIT + CLEAR, b"junk" + HIT]),
              st.integers(0, 1), st.just(0)),
    st.tuples(st.just("wait"), st.just(b""), st.just(0), st.integers(0, 120)),
)  # fmt: skip


class Search:
    """A relay, the time, and an independent record of what may pass."""

    def __init__(self) -> None:
        self.relay = Relay(NOW)
        self.now_ns = self.braked_ns = NOW
        self.renewed_ns = NOW - LEASE_NS  # arrival of the newest accepted command
        self.free = False  # a neutral command arrived since the last interruption or new hit
        self.relay.tick(NOW)

    def pc(self, datagram: bytes, port: int, late_ms: int) -> None:
        """Receive from the PC what may have arrived some time ago."""
        received_ns = self.now_ns - late_ms * MS
        self.free = self.free and self.now_ns - self.renewed_ns <= LEASE_NS
        sends = self.relay.from_pc(datagram, port, received_ns, self.now_ns)
        fresh = self.now_ns - received_ns <= LEASE_NS
        if datagram in MOVING:
            assert ((BOARD, port, datagram) in sends) == (self.free and fresh)
        if fresh and (datagram in NEUTRAL or (self.free and datagram in MOVING)):
            self.renewed_ns = max(self.renewed_ns, received_ns)
            self.free = True

    def board(self, datagram: bytes, port: int, number: int) -> None:
        """Receive from the board."""
        sends = self.relay.from_board(datagram, port, self.now_ns)
        assert sends[-1] == (PC, port, datagram)
        if len(sends) > 1:  # a new hit
            assert HIT in datagram
            self.free, self.braked_ns = False, self.now_ns

    def wait(self, datagram: bytes, port: int, after_ms: int) -> None:
        """Tick as the shell does."""
        for _ in range(after_ms * MS // TICK_NS):
            self.now_ns += TICK_NS
            self.free = self.free and self.now_ns - self.renewed_ns <= LEASE_NS
            if (BOARD, 0, wire.BRAKE) in self.relay.tick(self.now_ns):
                assert not self.free
                self.braked_ns = self.now_ns
            assert self.free or self.now_ns - self.braked_ns <= BRAKE_PERIOD_NS


@settings(max_examples=300, deadline=None)
@given(st.lists(EVENTS, max_size=60))
def test_no_run_passes_without_its_conditions(events: list[tuple[str, bytes, int, int]]) -> None:
    it = Search()
    for name, datagram, port, number in events:
        getattr(it, name)(datagram, port, number)
        assert bool(it.relay.braking) or it.free
    for datagram in (ZERO, RUN):  # never locked
        assert (BOARD, 0, datagram) in it.relay.from_pc(datagram, 0, it.now_ns, it.now_ns)
