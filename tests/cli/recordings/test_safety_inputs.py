"""Inputs of safety in recorded messages: times, order, and recordings that show none."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from cli.recordings.safety_inputs import Recorded, Step, runs
from t2 import messages as m
from t2.errors import T2Error
from tests import factories

MS = 1_000_000
LOG_NS = 1_700_000_000_000_000_000  # of safety's time 0
HOST = 7


def recorded(path: str, message: m.Message | None, at_ms: int, late_ms: float = 1) -> Recorded:
    """Return a message that safety's host sent at this time."""
    if message is not None:
        message = replace(message, mono_ns=at_ms * MS, host=HOST)
    return Recorded(path, message, LOG_NS + round((at_ms + late_ms) * MS))


def motion(number: int, at_ms: int, judged: int, **fields: int) -> Recorded:
    sent = m.Motion(seq=number, boot=5, command=m.Command.STOP, judged=judged, judged_boot=3)
    return recorded("@cmd/motion", replace(sent, **fields), at_ms)


def bumper(number: int, at_ms: int) -> Recorded:
    return recorded("tel/bridge/bumper", m.Bumper(seq=number, boot=3, pressed=False), at_ms)


def velocity(number: int, at_ms: int) -> Recorded:
    sent = m.Velocity(seq=number, boot=3, linear=0.0, angular=0.0)
    return recorded("tel/bridge/velocity", sent, at_ms)


def complete(*messages: Recorded) -> list[Recorded]:
    """Return messages beside at least one of each stream that is needed."""
    sonars = m.Ultrasonic(ranges=(1.0,) * 8, status=("ok",) * 8)
    needed = [
        recorded("tel/bridge/ultrasonic", sonars, 0),
        recorded("tel/bridge/driver/left", m.Driver(faults=(), bits=0), 0),
        recorded("tel/bridge/link", factories.link(), 0),
        recorded("tel/safety/state", factories.safety_state(boot=5), 0),
        velocity(1, 0),
    ]
    return sorted([*needed, *messages], key=lambda one: one.log_ns)


def at(steps: list[Step], kind: type[m.Message] | None) -> list[float]:
    """Return the times of a stream's messages, ms."""
    found = [s for s in steps if (s.message is None if kind is None else type(s.message) is kind)]
    return [round(step.at_ns / MS, 2) for step in found]


@pytest.mark.parametrize(
    ("judged", "times"),
    [
        ((1, 2), [100, 119]),  # as sent
        ((0, 2), [100, 119]),  # the first one arrived after the first motion: 1 ns later
        ((1, 1), [100, 120]),  # the second one after the second motion
    ],
)
def test_a_motion_names_the_bumper_samples_before_it(
    judged: tuple[int, int], times: list[float]
) -> None:
    (run,) = runs(
        complete(
            motion(1, 100, judged[0]), motion(2, 120, judged[1]), bumper(1, 100), bumper(2, 119)
        )
    )
    assert at(run.drive_link, m.Bumper) == times


def test_the_bridges_messages_keep_their_order_around_a_sample() -> None:
    messages = (motion(1, 100, 1), motion(2, 120, 1), bumper(1, 100), bumper(2, 118))
    (run,) = runs(complete(*messages, velocity(2, 119)))
    assert [type(step.message) for step in run.drive_link] == [m.Bumper, m.Bumper, m.Velocity]
    assert all(step.at_ns > 120 * MS for step in run.drive_link[1:])


@pytest.mark.parametrize(
    ("sent_ns", "host", "at_ms"),
    [(5105 * MS, HOST, 5105), (5105 * MS, 8, 5109), (0, HOST, 5109), (9 * 10**9, HOST, 5109)],
)
def test_a_request_has_the_time_of_its_host_or_of_its_arrival(
    sent_ns: int, host: int, at_ms: int
) -> None:
    drive = m.Drive(echo=1, linear=0.1, angular=0.0, mono_ns=sent_ns, host=host)
    late = Recorded("@cmd/drive/web", drive, LOG_NS + 5110 * MS)  # 1 ms later, as each message
    (run,) = runs(complete(motion(1, 5100, 1), motion(2, 5120, 1), bumper(1, 99), late))
    assert at(run.router, m.Drive) == [at_ms]
    assert [step.name for step in run.router if isinstance(step.message, m.Drive)] == ["web"]


def test_an_emergency_stop_has_the_time_of_its_arrival() -> None:
    stop = Recorded("estop", None, LOG_NS + 111 * MS)
    (run,) = runs(complete(motion(1, 100, 1), motion(2, 120, 1), bumper(1, 99), stop))
    assert at(run.router, None) == [110]


def test_each_start_of_safety_is_a_run_with_its_own_states() -> None:
    other = recorded("tel/safety/state", factories.safety_state(boot=6), 5020)
    found = runs(
        complete(
            *(motion(1, 100, 1), motion(2, 120, 1), bumper(1, 99), bumper(2, 5001), other),
            *(motion(1, 5000, 1, boot=6), motion(2, 5040, 2, boot=6)),
        )
    )
    assert [run.boot for run in found] == [5, 6]
    assert at(found[0].router, m.SafetyState) == []
    assert at(found[1].router, m.SafetyState) == [5020, 5020]  # sent, and received back


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda _: [], "has no @cmd/motion, no tel/bridge/velocity"),
        (
            lambda all_: [one for one in all_ if not isinstance(one.message, m.Motion)],
            "has no @cmd/motion: the decisions of safety cannot be repeated",
        ),
        (
            lambda all_: [one for one in all_ if one.path != "tel/bridge/link"],
            "has no tel/bridge/link",
        ),
        (
            lambda all_: [*all_, *(velocity(number, 200) for number in range(3, 99, 3))],
            "messages on tel/bridge/velocity: laptops get downsampled streams",
        ),
        (
            lambda all_: [*all_, motion(3, 90, 1)],
            "the clock of safety jumps back by 0.030 s at motion 3",
        ),
    ],
)
def test_what_is_refused(change: Callable[[list[Recorded]], list[Recorded]], reason: str) -> None:
    with pytest.raises(T2Error, match=reason):
        runs(change(complete(motion(1, 100, 1), motion(2, 120, 1), bumper(1, 99))))
