"""Inputs of safety in the messages of a recording, in the order of their times. Pure.

All times are those of safety's clock, the monotonic clock of its host:

- a message of the same host has the time when it was sent (``mono_ns``)
- any other message has the time when the recorder received it. The offset of both clocks is the
  smallest difference between reception and sending of a message of safety's host

A recording does not contain when safety took a message. So the order of messages that are less
than ``UNSURE_NS`` apart is unknown. One part of it is known: each motion names the newest bumper
sample in its decision, and all messages of the bridge arrive on one link in their order.

A *run* is one start of safety, by the ``boot`` of its motions.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise

from common.freshness import NS_PER_S
from t2 import keys
from t2.errors import T2Error
from t2.messages import (
    Bumper,
    Drive,
    Driver,
    Limit,
    Link,
    Message,
    Mileage,
    Motion,
    SafetyState,
    Switches,
    Ultrasonic,
    Velocity,
)

UNSURE_NS = NS_PER_S // 50  # one decision
LATEST_NS = 2 * NS_PER_S  # from sending to the recorder; a greater one is of another clock
LOST_SHARE = 0.2  # of a stream's messages; a downsampled one loses more than half
NEEDED: dict[type[Message], str] = {
    Motion: keys.MOTION.path,
    Velocity: keys.VELOCITY.path,
    Ultrasonic: keys.ULTRASONIC.path,
    Bumper: keys.BUMPER.path,
    Driver: "tel/bridge/driver/*",
    Link: keys.LINK.path,
    SafetyState: keys.SAFETY.path,
}
OF_BRIDGE = (Velocity, Mileage, Ultrasonic, Bumper, Driver, Switches, Link)
OTHERS: tuple[type[Message], ...] = (Mileage, Switches, Drive, Limit)
KINDS = {kind.__name__ for kind in (*NEEDED, *OTHERS)}


@dataclass(frozen=True, slots=True)
class Recorded:
    """A recorded message; None is a sample on the emergency stop's key."""

    path: str  # its key, below the robot
    message: Message | None
    log_ns: int  # when the recorder received it


@dataclass(frozen=True, slots=True)
class Step:
    """A message that reaches safety, at a time on safety's clock."""

    at_ns: int
    path: str
    message: Message | None
    is_echo: bool = False  # safety's own state, received back through the router

    @property
    def name(self) -> str:
        """The last part of its key: the source of a request, the side of a driver."""
        return self.path.rpartition("/")[2]


@dataclass(slots=True)
class Run:
    """One start of safety: its motions, and what it received, by time."""

    boot: int
    offset_ns: int  # the recording's time less that of safety's clock
    motions: list[Motion] = field(default_factory=list)
    # By the link on which they arrive; each in the order of time.
    drive_link: list[Step] = field(default_factory=list)
    router: list[Step] = field(default_factory=list)

    def logged_ns(self, at_ns: int) -> int:
        """Return a time of safety's clock as a time of the recording."""
        return at_ns + self.offset_ns


def is_input(path: str, kind: str) -> bool:
    """Return whether the replay needs a message with this key, below the robot, and this type."""
    return kind in KINDS or path == keys.ESTOP_PATH


def runs(recorded: list[Recorded]) -> list[Run]:
    """Return the runs of safety in the messages of one robot.

    Raise ``T2Error`` if they do not show what safety received.
    """
    _check(recorded)
    boots: dict[int, list[Recorded]] = {}
    for one in recorded:
        if isinstance(one.message, Motion):
            boots.setdefault(one.message.boot, []).append(one)
    return [_run(boot, motions, recorded) for boot, motions in boots.items()]


def _check(recorded: list[Recorded]) -> None:
    found = {type(one.message) for one in recorded}
    missing = [path for kind, path in NEEDED.items() if kind not in found]
    if missing:
        raise T2Error(
            f"has no {', no '.join(missing)}: the decisions of safety cannot be repeated; record "
            "on the robot, with `t2 record` or the black box"
        )
    for kind in (Motion, Velocity, Bumper):
        numbers = [(it.boot, it.seq) for one in recorded if isinstance(it := one.message, kind)]
        steps = Counter(b[1] - a[1] for a, b in pairwise(sorted(numbers)) if a[0] == b[0])
        lost = sum((step - 1) * count for step, count in steps.items() if step > 0)
        if lost > LOST_SHARE * (lost + len(numbers)):
            raise T2Error(
                f"has {len(numbers)} of {lost + len(numbers)} messages on {NEEDED[kind]}: laptops "
                "get downsampled streams over TLS (bus.laptop_rate), so record on the robot"
            )


def _run(boot: int, motions: list[Recorded], recorded: list[Recorded]) -> Run:
    sent = sorted((it for one in motions if isinstance(it := one.message, Motion)), key=_by_seq)
    for before, after in pairwise(sent):
        if after.mono_ns < before.mono_ns:
            raise T2Error(
                f"the clock of safety jumps back by {(before.mono_ns - after.mono_ns) / 1e9:.3f} s "
                f"at motion {after.seq}: ages cannot be known; use another recording"
            )
    host = sent[0].host
    offset_ns = min(one.log_ns - it.mono_ns for one in motions if (it := one.message))
    near = range(motions[0].log_ns - LATEST_NS, motions[-1].log_ns + LATEST_NS)
    run = Run(boot, offset_ns, sent)
    steps = [
        step
        for one in recorded
        if one.log_ns in near and not isinstance(one.message, Motion)
        for step in _steps(one, run, host)
    ]
    # A decision before the first motion is none of this file, and perhaps none of this run.
    steps = [step for step in steps if step.at_ns >= sent[0].mono_ns]
    steps.sort(key=lambda step: step.at_ns)
    run.router = [step for step in steps if not isinstance(step.message, OF_BRIDGE)]
    run.drive_link = _after_judged((s for s in steps if isinstance(s.message, OF_BRIDGE)), sent)
    return run


def _by_seq(message: Message) -> int:
    return message.seq


def _steps(one: Recorded, run: Run, host: int) -> Iterator[Step]:
    """Yield a message at its time; a state of safety is received back, too."""
    message, arrived_ns = one.message, one.log_ns - run.offset_ns
    if isinstance(message, SafetyState) and message.boot != run.boot:
        return
    if message is None or message.host != host:
        yield Step(arrived_ns, one.path, message)
        return
    is_plausible = -UNSURE_NS <= arrived_ns - message.mono_ns <= LATEST_NS
    at_ns = message.mono_ns if is_plausible else arrived_ns
    if isinstance(message, SafetyState):
        yield Step(at_ns + 1, one.path, message)  # after the motion of the same decision
        yield Step(max(arrived_ns, at_ns + 1), one.path, message, is_echo=True)
        return
    yield Step(at_ns, one.path, message)


def _after_judged(steps: Iterable[Step], motions: list[Motion]) -> list[Step]:
    """Return the bridge's messages at times that fit the bumper samples that the motions name.

    A sample that a motion names was received before it, and a later one after it. The messages of
    the bridge between two samples are received between them.
    """
    position, least_ns = 0, 0
    moved: list[Step] = []
    for step in steps:
        at_ns, sample = step.at_ns, step.message
        if isinstance(sample, Bumper):
            while position < len(motions) and _is_before(motions[position], sample):
                position += 1
            if position < len(motions) and motions[position].judged_boot == sample.boot:
                at_ns = min(at_ns, motions[position].mono_ns)
            if position > 0 and motions[position - 1].judged_boot == sample.boot:
                least_ns = max(least_ns, motions[position - 1].mono_ns + 1)
        at_ns = max(at_ns, least_ns)
        least_ns = at_ns
        moved.append(Step(at_ns, step.path, sample))
    return moved


def _is_before(motion: Motion, sample: Bumper) -> bool:
    """Return whether a motion was decided without this sample."""
    if motion.judged_boot != sample.boot:
        return motion.mono_ns < sample.mono_ns
    return motion.judged < sample.seq
