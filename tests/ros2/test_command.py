"""Commands that are passed on, and those that a network held back, doubled or mixed."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.ros2.attachment import Attachment
from services.ros2.command import MAX_PUBLISHERS, Commands, Refusal, Request, Twist

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


def test_a_command_is_passed_on_as_it_is() -> None:
    sender = Sender(Commands()).settle()
    assert sender.send(1.0, motion=twist(0.3, -0.5)) == Request(0.3, -0.5)


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


def test_a_publisher_that_was_silent_for_long_begins_anew() -> None:
    sender = Sender(Commands()).settle()
    assert sender.send(60.5) == Request(0.3, 0.0)
    assert sender.send(121.0) == "settling"
    assert sender.send(121.6) == "not_neutral"
    assert sender.commands.owner is None


def test_what_waited_in_a_busy_host_is_refused() -> None:
    commands = Commands()
    sender = Sender(commands).settle()
    sender.send(1.0)
    about = Attachment(99, CLOCK + 2 * S, NAV)
    late = commands.judge(about, twist(0.3), 2 * S + 10 * MS, 2 * S + 220 * MS)
    assert isinstance(late, Refusal)
    assert late.name == "held_back"


@pytest.mark.parametrize(("delay_s", "held"), [(0.2, False), (0.22, True), (5.0, True)])
def test_what_the_network_held_back_is_refused(delay_s: float, held: bool) -> None:
    sender = Sender(Commands()).settle()
    decided = sender.send(1.0, delay_s)
    assert decided == ("held_back" if held else Request(0.3, 0.0))


def test_a_burst_after_a_gap_is_refused_and_the_next_live_command_taken() -> None:
    sender = Sender(Commands()).settle()
    burst = [sender.send(1.0 + number / 20, 3.0 - number / 20) for number in range(55)]
    assert set(burst) == {"held_back"}
    assert sender.send(4.0) == Request(0.3, 0.0)


def test_a_burst_of_a_new_publisher_is_refused() -> None:
    sender = Sender(Commands())
    burst = [sender.send(number / 20, 3.0 - number / 20) for number in range(60)]
    assert set(burst) == {"settling"}


def test_a_queue_that_drains_slowly_is_refused() -> None:
    """Each command takes less long than the one before: none of them is fresh."""
    sender = Sender(Commands())
    decided = [sender.send(number / 20, max(0.01, 3.0 - number / 100)) for number in range(240)]
    assert set(decided) == {"settling"}


def test_a_clock_that_is_set_forward_settles_anew() -> None:
    sender = Sender(Commands()).settle()
    sender.commands.judge(Attachment(900, CLOCK + 60 * S, NAV), twist(), S, S)
    about = Attachment(901, CLOCK + 60 * S + 20 * MS, NAV)
    later_ns = S + 20 * MS
    decided = sender.commands.judge(about, twist(0.3), later_ns, later_ns)
    assert isinstance(decided, Refusal)
    assert decided.name == "settling"


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


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("axis", range(6))
def test_numbers_that_are_not_finite(number: float, axis: int) -> None:
    axes = [0.0] * 6
    axes[axis] = number
    sender = Sender(Commands()).settle()
    motion = Twist((axes[0], axes[1], axes[2]), (axes[3], axes[4], axes[5]))
    assert sender.send(1.0, motion=motion) == "not_finite"


@pytest.mark.parametrize("axis", [1, 2, 3, 4])
def test_other_axes(axis: int) -> None:
    axes = [0.0] * 6
    axes[axis] = 0.01
    sender = Sender(Commands()).settle()
    motion = Twist((axes[0], axes[1], axes[2]), (axes[3], axes[4], axes[5]))
    assert sender.send(1.0, motion=motion) == "other_axes"


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
