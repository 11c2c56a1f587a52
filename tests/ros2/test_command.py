"""Commands that are passed on, and those that a network held back, doubled or mixed."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.messages import MAX_NUMBER
from services.ros2.cdr import Attachment
from services.ros2.command import (
    FASTER_NS,
    HELD_BACK_NS,
    IDLE_NS,
    MAX_PUBLISHERS,
    OWNER_NS,
    SETTLE_NS,
    Commands,
    Refusal,
    Request,
    Twist,
)

S = 10**9
MS = 10**6
NAV, JOY = b"n" * 16, b"j" * 16
CLOCK = 1_700_000_000 * S  # of the senders: it has nothing to do with ours


def twist(linear: float = 0.0, angular: float = 0.0, sideways: float = 0.0) -> Twist:
    return Twist((linear, sideways, 0.0), (0.0, 0.0, angular))


class Sender:
    """A publisher that sends 20 times a second over a network with a delay."""

    def __init__(self, commands: Commands, gid: bytes = NAV) -> None:
        self.commands, self.gid, self.sequence = commands, gid, 0

    def send(self, sent_s: float, delay_s: float = 0.01, motion: Twist | None = None) -> object:
        """Judge a command; return it, or the refusal's name."""
        self.sequence += 1
        about = Attachment(self.sequence, CLOCK + round(sent_s * S), self.gid)
        received_ns = round((sent_s + delay_s) * S)
        decided = self.commands.judge(about, motion or twist(0.3), received_ns, received_ns)
        return decided.name if isinstance(decided, Refusal) else decided

    def settle(self, until_s: float = 1.0) -> "Sender":
        """Send neutral commands until this time."""
        for number in range(round(until_s * 20)):
            decided = self.send(number / 20, motion=twist())
            assert decided == ("settling" if number < 10 else Request(0.0, 0.0))
        return self


def test_a_new_publisher_moves_nothing_at_first() -> None:
    sender = Sender(Commands())
    assert sender.send(0.0) == "settling"
    assert sender.send(0.1, motion=twist()) == "settling"  # it may be old, too
    assert sender.send(0.45) == "settling"
    assert sender.send(0.55) == "not_neutral"
    assert sender.send(0.6, motion=twist()) == Request(0.0, 0.0)
    assert sender.send(0.65) == Request(0.3, 0.0)


@pytest.mark.parametrize(("idle_s", "delay_s"), [(59.0, 0.3), (3600.0, 1.9), (36000.0, 15.0)])
def test_what_was_held_back_after_a_silence_is_refused(idle_s: float, delay_s: float) -> None:
    sender = Sender(Commands()).settle()
    sender.send(1.0)
    begin_s = 1.0 + idle_s
    burst = [sender.send(begin_s + n / 20, delay_s - n / 20) for n in range(int(delay_s * 20))]
    assert Request(0.3, 0.0) not in burst[: int((delay_s - 0.25) * 20)]


def test_a_burst_after_a_gap_is_refused_and_the_next_live_command_taken() -> None:
    sender = Sender(Commands()).settle()
    burst = [sender.send(1.0 + number / 20, 3.0 - number / 20) for number in range(55)]
    assert set(burst) == {"held_back"}
    assert sender.send(4.0) == Request(0.3, 0.0)


def test_a_queue_that_drains_slowly_is_refused() -> None:
    """Each command takes less long than the one before: none of them is fresh."""
    sender = Sender(Commands())
    decided = [sender.send(number / 20, max(0.01, 3.0 - number / 100)) for number in range(240)]
    assert set(decided) == {"settling"}


def test_a_clock_that_drifts_is_no_delay() -> None:
    sender = Sender(Commands()).settle()
    drift = 100e-6
    for second in range(1, 7200, 10):
        assert sender.send(float(second), 0.01 + drift * second) == Request(0.3, 0.0)


def test_one_publisher_drives_until_it_is_silent() -> None:
    commands = Commands()
    nav, joy = Sender(commands).settle(), Sender(commands, JOY)
    for number in range(20):
        nav.send(1.0 + number / 20)
        assert joy.send(1.0 + number / 20) in ("settling", "second_publisher")
    assert joy.send(2.0) == "second_publisher"
    assert joy.send(2.5) == "not_neutral"
    assert joy.send(2.51, motion=twist()) == Request(0.0, 0.0)
    assert joy.send(2.52) == Request(0.3, 0.0)
    assert nav.send(2.55) == "second_publisher"


def test_the_next_publisher_may_begin_at_once_when_the_owner_is_gone() -> None:
    commands = Commands()
    nav, joy = Sender(commands).settle(), Sender(commands, JOY)
    assert joy.send(0.3) == "settling"
    nav.send(1.0)
    commands.gone(NAV)
    assert joy.send(1.01) == "not_neutral"
    assert joy.send(1.02, motion=twist()) == Request(0.0, 0.0)
    assert joy.send(1.03) == Request(0.3, 0.0)


def test_a_command_that_is_repeated_or_late_is_refused() -> None:
    sender = Sender(Commands()).settle()
    sender.send(1.0)
    sender.sequence -= 1
    assert sender.send(1.05) == "out_of_order"
    sender.sequence -= 3
    assert sender.send(1.1) == "out_of_order"


@pytest.mark.parametrize("axis", range(6))
def test_numbers_that_are_not_finite_and_other_axes(axis: int) -> None:
    sender = Sender(Commands()).settle()
    for number in (math.nan, math.inf, -math.inf, 1.1 * MAX_NUMBER, MAX_NUMBER, 0.01):
        axes = [0.0] * 6
        axes[axis] = number
        motion = Twist((axes[0], axes[1], axes[2]), (axes[3], axes[4], axes[5]))
        taken = "other_axes" if axis in (1, 2, 3, 4) else Request(axes[0], axes[5])
        expected = taken if number in (MAX_NUMBER, 0.01) else "not_finite"
        assert sender.send(1.0, motion=motion) == expected


def test_a_refused_command_does_not_make_an_owner() -> None:
    commands = Commands()
    nav, joy = Sender(commands).settle(0.6), Sender(commands, JOY)
    assert joy.send(1.2, motion=twist(sideways=1.0)) == "other_axes"
    assert commands.owner == NAV
    assert nav.send(1.2) == Request(0.3, 0.0)


def test_many_publishers_are_not_remembered() -> None:
    commands = Commands()
    for number in range(3 * MAX_PUBLISHERS):
        Sender(commands, number.to_bytes(16, "big")).send(number / 100)
    assert len(commands._known) == MAX_PUBLISHERS


START_NS = 10**12  # our clock; the senders' clocks are 0 then
TAKEN, NEUTRAL = Request(0.3, 0.0), Request(0.0, 0.0)


def at(
    commands: Commands, sequence: int, at_ns: int, *, late_ns: int = 0, waited_ns: int = 0,
    speed: float = 0.3, gid: bytes = NAV,
) -> object:  # fmt: skip
    """Judge a command that was sent ``late_ns`` before it arrives; return it, or why not."""
    about, now_ns = Attachment(sequence, at_ns - late_ns, gid), START_NS + at_ns
    decided = commands.judge(about, twist(speed), now_ns, now_ns + waited_ns)
    return decided.name if isinstance(decided, Refusal) else decided


@pytest.fixture
def commands() -> Commands:
    """Return a judge that has just taken a command of NAV, at 1 s."""
    made = Commands()
    assert at(made, 0, 0, speed=0.0) == "settling"
    assert at(made, 1, SETTLE_NS - 1, speed=0.0) == "settling"
    assert at(made, 2, SETTLE_NS, speed=0.0) == NEUTRAL
    assert at(made, 3, S) == TAKEN
    return made


def test_the_limit_of_a_faster_delivery_that_settles_anew() -> None:
    made = Commands()
    at(made, 1, 0, late_ns=FASTER_NS, speed=0.0)
    assert at(made, 2, SETTLE_NS, speed=0.0) == NEUTRAL  # exactly so much faster
    assert at(made, 3, SETTLE_NS, late_ns=-1) == "settling"


@pytest.mark.parametrize("where", ["late_ns", "waited_ns"])  # in the network, in a busy host
def test_the_limit_of_what_was_held_back(commands: Commands, where: str) -> None:
    assert at(commands, 4, S, **{where: HELD_BACK_NS}) == TAKEN  # type: ignore[arg-type]
    assert at(commands, 5, S, **{where: HELD_BACK_NS + 1}) == "held_back"  # type: ignore[arg-type]


def test_the_limit_of_the_owners_silence(commands: Commands) -> None:
    at(commands, 1, S - SETTLE_NS, speed=0.0, gid=JOY)
    assert at(commands, 2, S + OWNER_NS - 1, gid=JOY) == "second_publisher"
    assert at(commands, 3, S + OWNER_NS, gid=JOY) == "not_neutral"


def test_the_limit_of_a_silence_after_which_a_publisher_is_new(commands: Commands) -> None:
    assert at(commands, 4, S + IDLE_NS) == TAKEN
    assert at(commands, 5, S + 2 * IDLE_NS + 1) == "settling"
    assert commands.owner is None
    commands.gone(JOY)  # unknown


@given(
    st.lists(
        st.tuples(
            st.sampled_from([NAV, JOY]),
            st.integers(0, 5),  # what the sequence grows by
            st.floats(0.0, 0.5),  # s until the next command
            st.floats(0.0, 5.0),  # s of delay
            st.floats(width=32),
        ),
        max_size=60,
    )
)
def test_motion_is_never_older_than_allowed(
    sent: list[tuple[bytes, int, float, float, float]],
) -> None:
    """No command moves that took 0.2 s longer than the fastest one of its publisher."""
    commands, now_s = Commands(), 0.0
    fastest: dict[bytes, float] = {}
    sequences = {NAV: 0, JOY: 0}
    for gid, step, wait_s, delay_s, speed in sent:
        now_s += wait_s
        sequences[gid] += step
        about = Attachment(sequences[gid], CLOCK + round((now_s - delay_s) * S), gid)
        now_ns = round(now_s * S)
        decided = commands.judge(about, twist(speed), now_ns, now_ns)
        if step or gid not in fastest:
            fastest[gid] = min(fastest.get(gid, math.inf), delay_s)
        if isinstance(decided, Request):
            assert math.isfinite(decided.linear)
            assert delay_s - fastest[gid] < 0.2 + 5e-4 * now_s + 1e-6
