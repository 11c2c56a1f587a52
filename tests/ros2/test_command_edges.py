"""The limits of commands to the nanosecond, and the text of each refusal."""

import math

import pytest

from services.ros2.attachment import Attachment
from services.ros2.command import (
    FASTER_NS,
    HELD_BACK_NS,
    IDLE_NS,
    OWNER_NS,
    SETTLE_NS,
    Commands,
    Refusal,
    Request,
    Twist,
)

NAV, JOY = b"n" * 16, b"j" * 16
START_NS = 10**12  # our clock; the senders' clocks are 0 then
AHEAD = Twist((0.3, 0.0, 0.0), (0.0, 0.0, 0.0))
NEUTRAL = Twist((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
STANDING = Request(0.0, 0.0)
TAKEN = Request(0.3, 0.0)
NEW = "A publisher is new, or its delay changes. Commands are taken soon."


def judge(
    commands: Commands, sequence: int, at_ns: int, *, late_ns: int = 0,
    twist: Twist = AHEAD, gid: bytes = NAV,
) -> Request | Refusal:  # fmt: skip
    """Judge a command that arrives ``at_ns`` after the start and was sent ``late_ns`` before."""
    now_ns = START_NS + at_ns
    return commands.judge(Attachment(sequence, at_ns - late_ns, gid), twist, now_ns, now_ns)


@pytest.fixture
def commands() -> Commands:
    """Return a judge that has just taken a command of NAV, at 1 s."""
    made = Commands()
    judge(made, 0, 0, twist=NEUTRAL)
    judge(made, 1, SETTLE_NS, twist=NEUTRAL)
    judge(made, 2, 10**9)
    assert made.owner == NAV
    return made


def test_settling_ends_after_its_time() -> None:
    made = Commands()
    judge(made, 1, 0, twist=NEUTRAL)
    assert judge(made, 2, SETTLE_NS - 1, twist=NEUTRAL) == Refusal("settling", NEW)
    assert judge(made, 3, SETTLE_NS, twist=NEUTRAL) == STANDING


def test_a_delivery_that_is_much_faster_settles_anew() -> None:
    made = Commands()
    judge(made, 1, 0, late_ns=FASTER_NS, twist=NEUTRAL)
    assert judge(made, 2, SETTLE_NS, twist=NEUTRAL) == STANDING  # exactly so much faster
    assert judge(made, 3, SETTLE_NS, late_ns=-1) == Refusal("settling", NEW)


def test_held_back_begins_above_its_limit() -> None:
    made = Commands()
    judge(made, 1, 0, twist=NEUTRAL)
    judge(made, 2, SETTLE_NS, twist=NEUTRAL)
    assert judge(made, 3, SETTLE_NS, late_ns=HELD_BACK_NS) == TAKEN
    refused = judge(made, 4, SETTLE_NS, late_ns=HELD_BACK_NS + 1)
    assert refused == Refusal(
        "held_back",
        "A command took 0.2 s longer than the fastest of its publisher. The network held it back, "
        "or the publisher's clock was set: restart that node.",
    )


def test_another_publisher_drives_after_the_owners_silence(commands: Commands) -> None:
    judge(commands, 1, 10**9 - SETTLE_NS, twist=NEUTRAL, gid=JOY)
    assert judge(commands, 2, 10**9 + OWNER_NS - 1, gid=JOY) == Refusal(
        "second_publisher", "Another publisher drives. One at a time may."
    )
    assert judge(commands, 3, 10**9 + OWNER_NS, gid=JOY) == Refusal(
        "not_neutral", "A publisher that begins to drive must send a neutral command."
    )
    judge(commands, 4, 10**9 + OWNER_NS, twist=NEUTRAL, gid=JOY)
    assert judge(commands, 5, 10**9 + OWNER_NS, gid=JOY) == TAKEN


def test_a_publisher_that_is_gone_is_forgotten(commands: Commands) -> None:
    commands.gone(NAV)
    assert judge(commands, 1, 2 * 10**9) == Refusal("settling", NEW)
    commands.gone(JOY)  # unknown


def test_the_text_of_a_repeated_command(commands: Commands) -> None:
    assert judge(commands, 2, 10**9) == Refusal(
        "out_of_order", "A command arrived again, or after a later one."
    )


def test_the_texts_about_the_content(commands: Commands) -> None:
    not_finite = Twist((math.nan, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert judge(commands, 3, 10**9, twist=not_finite) == Refusal(
        "not_finite", "A command has a number that is not finite."
    )
    sideways = Twist((0.0, 0.1, 0.0), (0.0, 0.0, 0.0))
    assert judge(commands, 4, 10**9, twist=sideways) == Refusal(
        "other_axes",
        "A command asks for motion other than linear.x and angular.z. The vehicle cannot drive "
        "sideways through this interface.",
    )


def test_a_silence_of_exactly_the_limit_is_no_new_start(commands: Commands) -> None:
    assert judge(commands, 3, 10**9 + IDLE_NS) == TAKEN
    assert judge(commands, 4, 10**9 + 2 * IDLE_NS + 1) == Refusal("settling", NEW)
    assert commands.owner is None


def test_the_time_until_a_command_is_judged_counts(commands: Commands) -> None:
    at_ns = START_NS + 10**9
    for sequence, waited_ns, taken in ((3, HELD_BACK_NS, True), (4, HELD_BACK_NS + 1, False)):
        about = Attachment(sequence, 10**9, NAV)
        decided = commands.judge(about, AHEAD, at_ns, at_ns + waited_ns)
        assert (decided == TAKEN) == taken
