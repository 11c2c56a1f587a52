"""Commands that are passed on, and those that a network held back, doubled or mixed."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.ros2.cdr import Attachment
from services.ros2.command import (
    BEGINS,
    FASTER_NS,
    HELD_BACK_NS,
    LAPSE_NS,
    MAX_PUBLISHERS,
    OWNER_NS,
    PAUSE_NS,
    SETTLE_NS,
    SETTLES,
    SETTLING,
    UNHEARD,
    Commands,
    Refusal,
    Request,
    Twist,
    bars_motion,
)
from services.safety.core.causes import BY_NAME, RULES, Clears
from t2.catalogue import CAUSES
from t2.client import OVERRULED_TICKS
from t2.messages import MAX_NUMBER, Cause, CauseName, SafetyState
from tests import factories

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

    def send(
        self, sent_s: float, delay_s: float = 0.01, motion: Twist | None = None, *,
        barred: bool = False, seen: SafetyState | None = None,
    ) -> object:  # fmt: skip
        """Judge a command; return it, or what is refused."""
        self.sequence += 1
        about = Attachment(self.sequence, CLOCK + round(sent_s * S), self.gid)
        received_ns = round((sent_s + delay_s) * S)
        motion = motion or twist(0.3)
        newest = BARRED if barred else seen
        return shown(self.commands.judge(about, motion, received_ns, received_ns, newest))

    def drive(self, from_s: float = 0.0) -> "Sender":
        """Publish motion for 1 s, as a node that starts."""
        decided = [self.send(from_s + number / 20) for number in range(20)]
        assert decided == ["begins"] + ["settling"] * 9 + [Request(0.3, 0.0)] * 10
        return self

    def stream(self, from_s: float, seconds: float, **about: Any) -> set[object]:
        """Publish at 20 Hz; return all that was decided."""
        times = [from_s + number / 20 for number in range(round(seconds * 20))]
        return {self.send(each, **about) for each in times}


def shown(decided: Request | Refusal) -> object:
    """Return a request, or the name of a refusal; of the one that sends a neutral request, too."""
    if isinstance(decided, Request):
        return decided._replace(neutral_first=False)  # has a test of its own
    return "begins" if decided is BEGINS else decided.name


def test_ros2_topic_pub_drives_after_it_has_settled() -> None:
    """It starts, and repeats one message."""
    Sender(started()).drive()


def started(**settings: Any) -> Commands:
    """Return a judge that has listened for long."""
    commands = Commands(**settings)
    commands.listen(-60 * S)
    return commands


def test_a_keyboard_that_repeats_nothing_drives_with_its_second_press() -> None:
    sender = Sender(started())
    assert [sender.send(each) for each in (0.0, 0.45)] == ["begins", "settling"]
    assert [sender.send(each) for each in (0.5, 0.53, 1.4)] == [TAKEN] * 3
    assert [sender.send(each) for each in (3.0, 3.3, 3.6)] == ["begins", "settling", TAKEN]


@pytest.mark.parametrize("pause_s", [1.1, 70.0, 36000.0])
def test_a_planner_drives_on_after_any_pause_when_it_has_settled(pause_s: float) -> None:
    Sender(started()).drive().drive(1.0 + pause_s)


@pytest.mark.parametrize(("by_zero", "decided"), [(False, SETTLES), (True, SETTLING)])
def test_a_publisher_that_settles_after_a_pause_requests_zero(
    by_zero: bool, decided: Refusal
) -> None:
    """Otherwise a vehicle that stands would want a neutral request again."""
    commands = started(by_zero=by_zero)
    for number in range(2):
        about = Attachment(number, number * S // 10, NAV)
        last = commands.judge(about, twist(0.3), about.source_ns, about.source_ns, None)
    assert last is decided
    assert last.is_neutral is not by_zero


@pytest.mark.parametrize(
    ("pause_ns", "speed", "neutral_first"),
    [(PAUSE_NS - 1, 0.3, False), (PAUSE_NS, 0.3, True), (LAPSE_NS - 1, 0.3, True), (S, 0.0, False)],
)
@pytest.mark.parametrize("by_zero", [False, True])
def test_a_command_after_a_pause_has_a_neutral_request_before_it(
    pause_ns: int, speed: float, neutral_first: bool, by_zero: bool
) -> None:
    """The vehicle may have come to rest meanwhile: safety wants a neutral request then."""
    commands = started(by_zero=by_zero)
    for number in range(21):
        motion = twist(0.0 if by_zero and number < 15 else 0.3)
        moved = Attachment(number, number * S // 20, NAV)
        assert commands.judge(moved, motion, moved.source_ns, moved.source_ns, None)
    at_ns = S + min(pause_ns, LAPSE_NS - 1)
    decided = commands.judge(Attachment(21, at_ns, NAV), twist(speed), at_ns, at_ns, None)
    assert decided == Request(speed, 0.0, neutral_first=neutral_first and not by_zero)


def test_motion_across_a_reset_is_refused_until_a_pause() -> None:
    sender = Sender(started()).drive()
    assert sender.stream(1.0, 1.0, barred=True) == {"not_paused"}
    assert sender.stream(2.0, 5.0) == {"not_paused"}
    sender.drive(7.5)


def test_motion_while_it_settles_counts_as_motion_across_a_reset() -> None:
    sender = Sender(started())
    assert sender.send(0.0) == "begins"
    assert sender.send(0.3, barred=True) == "not_paused"
    assert sender.stream(0.35, 2.0) == {"not_paused"}


def test_zeros_are_passed_on_while_motion_is_barred_and_are_a_pause() -> None:
    sender = Sender(started()).drive()
    assert sender.stream(1.0, 1.0, motion=twist(), barred=True) == {NEUTRAL}
    assert sender.send(2.0) == TAKEN
    assert sender.send(2.05, barred=True) == "not_paused"
    assert sender.stream(2.1, 0.4, motion=twist()) == {"not_paused"}
    assert sender.send(2.55, motion=twist()) == "begins"


@pytest.mark.parametrize("motion", [twist(math.nan), twist(0.3, sideways=0.1)])
def test_a_refused_command_across_a_reset_is_motion(motion: Twist) -> None:
    sender = Sender(started()).drive()
    sender.stream(1.0, 1.0, motion=motion, barred=True)
    assert sender.stream(2.0, 1.0) == {"not_paused"}


def test_what_a_network_holds_back_across_a_reset_is_motion() -> None:
    sender = Sender(started()).drive()
    assert sender.send(1.0, 0.3, barred=True) == "held_back"
    assert sender.stream(1.35, 1.0) == {"not_paused"}


def state(*causes: CauseName, source: str | None = "ros2") -> SafetyState:
    """Return a state with these causes, in which this source is in control."""
    rows = [BY_NAME[name] for name in causes]
    held = tuple(
        Cause(name=row.name, action=row.action, age=1.0, text=CAUSES[row.name].text[0])
        for row in rows
    )
    return factories.safety_state(source=source, causes=held)


BARRED = state("estop")


def test_the_causes_that_bar_motion_are_those_of_safety() -> None:
    """Each rule that ends with a neutral request, and the wait for it."""
    assert not bars_motion(None)
    for rule in RULES:
        expected = rule.clears is not Clears.AT_ONCE or rule.name == "neutral"
        assert bars_motion(state(rule.name)) is expected, rule.name


@pytest.mark.parametrize("other", ["teleop", "nav"])
def test_who_was_overruled_must_pause(other: str) -> None:
    """For a moment the state may show the source that was in control before."""
    sender = Sender(started()).drive()
    seen = [sender.send(1.0 + number / 20, seen=state(source=other)) for number in range(20)]
    assert seen == [TAKEN] * (OVERRULED_TICKS - 1) + ["not_paused"] * (21 - OVERRULED_TICKS)
    assert sender.stream(2.0, 1.0, seen=state()) == {"not_paused"}
    sender.drive(3.5)


def test_who_was_overruled_begins_with_a_pause_while_another_source_drives() -> None:
    other = state(source="nav")
    sender = Sender(started()).drive()
    assert sender.stream(1.0, 1.0, seen=other) == {TAKEN, "not_paused"}
    assert sender.send(2.5, seen=other) == "begins"
    assert sender.stream(2.55, 0.45, seen=other) == {"settling"}
    assert sender.stream(3.0, 0.45, seen=other) == {TAKEN}


def test_who_publishes_zeros_or_another_node_is_not_overruled() -> None:
    commands = started()
    sender = Sender(commands).drive()
    assert sender.stream(1.0, 1.0, motion=twist(), seen=state(source="teleop")) == {NEUTRAL}
    assert sender.stream(2.0, 1.0, seen=state(source=None)) == {TAKEN}
    assert sender.stream(3.0, 1.0, seen=state("blocked")) == {TAKEN}


@pytest.mark.parametrize("period_s", [0.52, 1.0])
def test_motion_at_a_low_rate_while_it_is_barred_is_no_pause(period_s: float) -> None:
    sender = Sender(started())
    times = [number * period_s for number in range(10)]
    assert {sender.send(each, barred=True) for each in times} == {"not_paused"}
    assert sender.send(10 * period_s) == "begins"


def test_a_publisher_that_was_running_before_it_is_heard_must_pause() -> None:
    sender = Sender(started())
    sender.sequence = UNHEARD
    assert sender.stream(0.1, 2.0) == {"not_paused"}
    sender.drive(2.6)
    sender = Sender(started())
    sender.sequence = 2 * UNHEARD
    assert sender.send(0.0) == "not_paused"


def test_the_first_commands_of_a_publisher_may_be_lost() -> None:
    sender = Sender(started())
    sender.sequence = UNHEARD - 1
    sender.drive()
    early = Commands()
    early.listen(0)
    assert Sender(early).stream(0.1, 2.0) == {"not_paused"}


def test_what_is_lost_is_no_pause() -> None:
    """A link that was down for 3 s, and the messages of that time with it."""
    sender = Sender(started()).drive()
    sender.sequence += 60
    assert sender.stream(4.0, 1.0) == {"not_paused"}
    sender.drive(5.6)


def test_what_a_network_holds_back_is_no_pause() -> None:
    sender = Sender(started()).drive()
    burst = [sender.send(1.0 + number / 20, 3.0 - number / 20) for number in range(55)]
    assert set(burst) == {"held_back"}
    assert sender.stream(3.8, 1.0) == {"not_paused"}
    sender.drive(5.3)


def test_a_clock_that_is_set_is_no_pause() -> None:
    sender = Sender(started()).drive()
    assert sender.send(1.0, barred=True) == "not_paused"
    assert sender.send(1000.05, -998.99) == "not_paused"


def test_a_beginning_that_was_held_back_does_not_count() -> None:
    """The node started before a reset, and its first commands arrive after it."""
    sender = Sender(started())
    assert sender.send(0.0, 3.0) == "begins"
    assert sender.send(2.95, 0.1) == "not_paused"
    assert sender.stream(3.1, 1.0) == {"not_paused"}


@pytest.mark.parametrize(("idle_s", "delay_s"), [(59.0, 0.3), (3600.0, 1.9), (36000.0, 15.0)])
def test_what_was_held_back_after_a_silence_is_refused(idle_s: float, delay_s: float) -> None:
    sender = Sender(started()).drive()
    begin_s = 1.0 + idle_s
    burst = [sender.send(begin_s + n / 20, delay_s - n / 20) for n in range(int(delay_s * 20))]
    assert TAKEN not in burst


def test_a_queue_that_drains_slowly_is_refused() -> None:
    """Each command takes less long than the one before: none of them is fresh."""
    sender = Sender(started())
    decided = [sender.send(number / 20, max(0.01, 3.0 - number / 100)) for number in range(240)]
    assert set(decided) == {"begins", "settling", "not_paused"}


@pytest.mark.no_cover
def test_a_clock_that_drifts_is_no_delay() -> None:
    sender = Sender(started()).drive()
    drift = 100e-6
    for number in range(72000):
        sent_s = 1.0 + number / 10
        assert sender.send(sent_s, 0.01 + drift * sent_s) == TAKEN


def test_one_publisher_drives_until_it_is_silent() -> None:
    commands = started()
    nav, joy = Sender(commands).drive(), Sender(commands, JOY)
    for number in range(20):
        nav.send(1.0 + number / 20)
        assert joy.send(1.0 + number / 20) == "second_publisher"
    assert joy.stream(2.0, 0.45) == {"second_publisher"}
    assert joy.stream(2.5, 1.0) == {"not_paused"}
    joy.drive(4.0)
    assert nav.send(5.0) == "second_publisher"


def test_a_publisher_of_zeros_does_not_begin_beside_another_one() -> None:
    commands = started()
    nav, joy = Sender(commands).drive(), Sender(commands, JOY)
    assert nav.stream(1.0, 0.5) == {TAKEN}
    assert joy.stream(1.0, 0.9, motion=twist()) == {"second_publisher"}
    assert joy.send(2.0, motion=twist()) == "begins"
    assert joy.send(2.5) == TAKEN


def test_the_next_publisher_may_begin_at_once_when_the_owner_is_gone() -> None:
    commands = started()
    nav, joy = Sender(commands), Sender(commands, JOY)
    assert joy.send(0.2) == "begins"
    nav.drive()
    commands.gone(JOY)  # it does not drive
    assert joy.send(0.95) == "second_publisher"
    commands.gone(NAV)
    assert commands.owner is None
    assert joy.send(1.45) == "begins"
    assert joy.send(1.95) == TAKEN


def test_a_command_that_is_repeated_or_late_is_refused() -> None:
    sender = Sender(started()).drive()
    sender.send(1.0)
    sender.sequence -= 1
    assert sender.send(1.05) == "out_of_order"
    sender.sequence -= 3
    assert sender.send(1.1) == "out_of_order"


@pytest.mark.parametrize("axis", range(6))
def test_numbers_that_are_not_finite_and_other_axes(axis: int) -> None:
    sender = Sender(started()).drive()
    for number in (math.nan, math.inf, -math.inf, 1.1 * MAX_NUMBER, MAX_NUMBER, 0.01):
        axes = [0.0] * 6
        axes[axis] = number
        motion = Twist((axes[0], axes[1], axes[2]), (axes[3], axes[4], axes[5]))
        taken = "other_axes" if axis in (1, 2, 3, 4) else Request(axes[0], axes[5])
        expected = taken if number in (MAX_NUMBER, 0.01) else "not_finite"
        assert sender.send(1.0, motion=motion) == expected


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("number", [0.000999, 1e-17, 5e-324, 0.0, -0.0, -1e-17, -0.000999])
def test_numbers_below_the_resolution_of_a_frame_are_zero(axis: int, number: float) -> None:
    """Controllers and filters compute such remainders, also on axes that they do not use."""
    sender = Sender(started()).drive()
    axes = [0.3, 0.0, 0.0, 0.0, 0.0, 0.5]
    axes[axis] = number
    motion = Twist((axes[0], axes[1], axes[2]), (axes[3], axes[4], axes[5]))
    taken = Request(0.0 if axis == 0 else 0.3, 0.0 if axis == 5 else 0.5)
    assert sender.send(1.0, motion=motion) == taken
    assert repr(sender.send(1.05, motion=motion)) == repr(taken)  # never -0.0


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("number", [0.001, -0.001])
def test_the_smallest_step_of_a_frame_is_motion(axis: int, number: float) -> None:
    sender = Sender(started()).drive()
    axes = [0.0] * 6
    axes[axis] = number
    motion = Twist((axes[0], axes[1], axes[2]), (axes[3], axes[4], axes[5]))
    expected = Request(axes[0], axes[5]) if axis in (0, 5) else "other_axes"
    assert sender.send(1.0, motion=motion) == expected


def test_remainders_on_every_axis_are_neutral() -> None:
    """A node that slows down by a filter never publishes zero exactly."""
    rest = Twist((1e-17, -1e-9, 0.0009), (-0.0, 5e-324, 1e-6))
    assert not rest.in_steps().moves
    sender = Sender(started(by_zero=True))
    sender.stream(0.0, 1.0, motion=rest)
    assert sender.send(1.0) == Request(0.3, 0.0)
    assert sender.stream(1.05, 1.0, barred=True) == {"not_zero"}
    sender.stream(2.05, 0.6, motion=rest)
    assert sender.send(2.7) == Request(0.3, 0.0)


def test_a_refused_command_does_not_make_an_owner() -> None:
    commands = started()
    nav, joy = Sender(commands).drive(), Sender(commands, JOY)
    assert joy.send(1.2, motion=twist(sideways=1.0)) == "other_axes"
    assert commands.owner == NAV
    assert nav.send(1.2) == TAKEN


def test_many_publishers_are_not_remembered() -> None:
    commands = started()
    for number in range(3 * MAX_PUBLISHERS):
        Sender(commands, number.to_bytes(16, "big")).send(number / 100)
    assert len(commands._known) == MAX_PUBLISHERS


def test_where_only_zeros_are_neutral_a_publisher_settles_and_sends_zero() -> None:
    sender = Sender(started(by_zero=True))
    assert sender.send(0.0) == "settling"
    assert sender.send(0.1, motion=twist()) == "settling"  # it may be old, too
    assert sender.send(0.55) == "not_zero"
    assert sender.send(0.6, motion=twist()) == NEUTRAL
    assert sender.send(0.65) == TAKEN
    assert sender.send(0.7, barred=True) == "not_zero"
    assert sender.send(1.5) == "not_zero"
    assert sender.send(1.55, motion=twist()) == NEUTRAL
    assert sender.send(1.6) == TAKEN
    assert sender.send(2.6, motion=twist()) == "settling"
    assert sender.send(3.1) == "not_zero"


@pytest.mark.parametrize("source_ns", [0, 10 * S])
def test_a_zero_that_begins_is_not_held_back_itself(source_ns: int) -> None:
    commands = started(by_zero=True)
    for sequence, (at_ns, motion) in enumerate([(0, twist()), (S // 2, twist()), (S, twist(0.3))]):
        about = Attachment(sequence, source_ns + at_ns, NAV)
        decided = commands.judge(about, motion, at_ns, at_ns, None)
        commands.gone(NAV)
    assert decided == TAKEN


START_NS = 10**12  # our clock; the senders' clocks are 0 then
TAKEN, NEUTRAL = Request(0.3, 0.0), Request(0.0, 0.0)


def at(
    commands: Commands, sequence: int, at_ns: int, *, late_ns: int = 0, waited_ns: int = 0,
    speed: float = 0.3, gid: bytes = NAV,
) -> object:  # fmt: skip
    """Judge a command that was sent ``late_ns`` before it arrives; return it, or why not."""
    about, now_ns = Attachment(sequence, at_ns - late_ns, gid), START_NS + at_ns
    return shown(commands.judge(about, twist(speed), now_ns, now_ns + waited_ns, None))


@pytest.fixture
def commands() -> Commands:
    """Return a judge that has just taken a command of NAV, at 1 s."""
    made = Commands()
    made.listen(START_NS - PAUSE_NS)
    assert at(made, 1, 0) == "begins"
    assert at(made, 2, SETTLE_NS - 1) == "settling"
    assert at(made, 3, SETTLE_NS) == TAKEN
    assert at(made, 4, S) == TAKEN
    return made


def test_the_limit_of_a_pause() -> None:
    made = Commands()
    made.listen(START_NS)
    assert at(made, 1, PAUSE_NS - 1) == "not_paused"
    assert at(made, 2, 2 * PAUSE_NS - 2) == "not_paused"
    assert at(made, 3, 3 * PAUSE_NS - 2) == "begins"


@pytest.mark.parametrize("clock", ["sender", "ours"])
def test_a_pause_is_one_by_both_clocks(clock: str) -> None:
    made = Commands()
    made.listen(START_NS)
    short_ns = PAUSE_NS - 1
    at(made, 1, 0)
    late_ns = 1 if clock == "sender" else -1
    assert at(made, 2, PAUSE_NS if clock == "sender" else short_ns, late_ns=late_ns) == "not_paused"


def test_the_limit_of_a_faster_delivery_that_settles_anew() -> None:
    made = started()
    at(made, 1, 0, late_ns=FASTER_NS)
    assert at(made, 2, SETTLE_NS) == TAKEN  # exactly so much faster
    assert at(made, 3, SETTLE_NS, late_ns=-1) == "settling"
    assert at(made, 4, 2 * SETTLE_NS - 1) == "settling"
    assert at(made, 5, 2 * SETTLE_NS) == TAKEN


@pytest.mark.parametrize("where", ["late_ns", "waited_ns"])  # in the network, in a busy host
def test_the_limit_of_what_was_held_back(commands: Commands, where: str) -> None:
    assert at(commands, 5, S, **{where: HELD_BACK_NS}) == TAKEN  # type: ignore[arg-type]
    assert at(commands, 6, S, **{where: HELD_BACK_NS + 1}) == "held_back"  # type: ignore[arg-type]


@pytest.mark.parametrize(("late_ns", "seen"), [(0, "settling"), (1, "not_paused")])
def test_the_limit_of_a_beginning_that_was_held_back(late_ns: int, seen: str) -> None:
    made = started()
    at(made, 1, 0, late_ns=HELD_BACK_NS + late_ns)
    assert at(made, 2, S // 10) == seen


def test_a_faster_delivery_of_the_one_that_drives_is_no_beginning(commands: Commands) -> None:
    assert at(commands, 5, S, late_ns=-HELD_BACK_NS - 1) == "settling"
    assert at(commands, 6, S + SETTLE_NS, late_ns=-HELD_BACK_NS - 1) == TAKEN


def test_the_limit_of_the_owners_silence(commands: Commands) -> None:
    assert at(commands, 1, S + OWNER_NS - 1, speed=0.0, gid=JOY) == "second_publisher"
    assert at(commands, 2, S + OWNER_NS, gid=JOY) == "begins"


def test_the_limit_of_a_silence_after_which_a_publisher_begins_anew(commands: Commands) -> None:
    assert at(commands, 5, S + LAPSE_NS - 1) == TAKEN
    assert at(commands, 6, S + 2 * LAPSE_NS - 1) == "begins"


@given(
    st.lists(
        st.tuples(
            st.sampled_from([NAV, JOY]),
            st.sampled_from([0, 0, 0, 1, 30]),  # commands that are lost
            st.sampled_from([0.05, 0.05, 0.1, 0.5, 0.6, 1.1]),  # s until it is sent
            st.sampled_from([0.3, 0.3, 0.3, 0.0, math.nan]),
            st.sampled_from([False, False, False, True]),
        ),
        max_size=80,
    )
)
def test_no_motion_before_a_pause_after_motion_that_was_barred(
    sent: list[tuple[bytes, int, float, float, bool]],
) -> None:
    """What is lost, refused or unheard is motion, too."""
    commands, now_s = started(), 0.0
    senders = {gid: Sender(commands, gid) for gid in (NAV, JOY)}
    moved_s = dict.fromkeys(senders, -60.0)
    paused = dict.fromkeys(senders, False)
    for gid, lost, wait_s, speed, barred in sent:
        now_s += wait_s
        sender = senders[gid]
        sender.sequence += lost
        if lost > UNHEARD or (lost and moved_s[gid] > 0):
            moved_s[gid] = now_s
        decided = sender.send(now_s, motion=twist(speed), barred=barred)
        paused[gid] = paused[gid] or now_s - moved_s[gid] > 0.49
        if speed:
            paused[gid] = paused[gid] and not barred
            moved_s[gid] = now_s
        if decided == TAKEN:
            assert paused[gid]


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
    commands, now_s = started(), 0.0
    fastest: dict[bytes, float] = {}
    sequences = {NAV: 0, JOY: 0}
    for gid, step, wait_s, delay_s, speed in sent:
        now_s += wait_s
        sequences[gid] += step
        about = Attachment(sequences[gid], CLOCK + round((now_s - delay_s) * S), gid)
        now_ns = round(now_s * S)
        decided = commands.judge(about, twist(speed), now_ns, now_ns, None)
        if step or gid not in fastest:
            fastest[gid] = min(fastest.get(gid, math.inf), delay_s)
        if isinstance(decided, Request):
            assert math.isfinite(decided.linear)
            assert delay_s - fastest[gid] < 0.2 + 5e-4 * now_s + 1e-6
