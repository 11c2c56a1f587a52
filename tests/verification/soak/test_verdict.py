"""Tables of good and failed soak results."""

import pytest

from cli.demo.score import Result
from common import motion
from common.freshness import NS_PER_S
from sim import trace as t
from verification.harness.trace import moves
from verification.soak.record import Life, Progress, Record, Sample, Window
from verification.soak.verdict import GROWTH_MAX, Limits, good, growth, results, too_late

RUN, STOP, BRAKE = motion.Command

MB = 2**20
LIMITS = Limits(warm_up_s=60.0, lap_s=120.0, stuck_s=75.0)
SAFETY = Life("safety", 10, 1)


def samples_of(
    seconds: int, rss_per_s: float = 0.0, threads_at: int = 10**9, since_s: int = 0
) -> list[Sample]:
    """Return a sample a second; one thread more from some second on."""
    return [
        Sample(since_s + s, round(50 * MB + rss_per_s * s), 10 + (s >= threads_at), 20)
        for s in range(seconds)
    ]


def well(seconds: int = 300) -> Record:
    """Return a soak in which nothing is wrong."""
    return Record(
        lives={SAFETY: samples_of(seconds)},
        progress=[
            Progress(s, what) for s in range(0, seconds, 10) for what in ("step", "lap finished")
        ],
        log=[(float(s), 500 * s) for s in range(seconds)],
        windows=[Window("kill safety", 0, NS_PER_S)],
        health={"safety": [float(s) for s in range(seconds)]},
        faults=[(20.0, "kill safety")],
        seconds=float(seconds),
    )


def row(record: Record, what: str) -> Result:
    (found,) = [row for row in results(record, LIMITS) if row[0] == what]
    return found


def test_a_good_soak_is_good() -> None:
    assert good(results(well(), LIMITS))


def test_a_soak_that_saw_nothing_is_not_good() -> None:
    wrong = {what for what, _, fine in results(Record(), LIMITS) if fine is False}
    assert wrong == {"log", "health", "faults", "longest time without a step done"}
    assert not good(results(Record(), LIMITS))


# --- growth -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("seconds", "rss_per_s", "megabytes"),
    [
        (300, 0.0, 0.0),
        (300, MB / 100, 1.92),  # 192 s from the middle of the first fifth to that of the last
        (300, -MB / 100, -1.92),
        (70, 0.0, 0.0),
    ],
)
def test_growth_is_that_of_the_medians(seconds: int, rss_per_s: float, megabytes: float) -> None:
    span = growth(samples_of(seconds, rss_per_s), 60.0)
    assert span is not None
    assert (span[1].rss - span[0].rss) / MB == pytest.approx(megabytes, abs=0.02)


@pytest.mark.parametrize("seconds", [1, 60, 69])
def test_a_short_life_is_not_judged(seconds: int) -> None:
    assert growth(samples_of(seconds), 60.0) is None


def test_what_is_taken_while_warming_up_is_no_growth() -> None:
    samples = [Sample(s, (50 if s > 59 else s) * MB, 10, 20) for s in range(300)]
    span = growth(samples, 60.0)
    assert span is not None
    assert span[0].rss == span[1].rss


@pytest.mark.parametrize(
    ("rss_per_s", "fine"),
    [(0.0, True), (0.9 * GROWTH_MAX / 192, True), (1.1 * GROWTH_MAX / 192, False)],
)
def test_memory_may_grow_by_less_than_the_limit(rss_per_s: float, fine: bool) -> None:
    record = well()
    record.lives = {SAFETY: samples_of(300, rss_per_s)}
    assert row(record, "safety: memory")[2] is fine


@pytest.mark.parametrize(("threads_at", "fine"), [(30, True), (150, False), (299, True)])
def test_a_thread_that_stays_is_growth(threads_at: int, fine: bool) -> None:
    record = well()
    record.lives = {SAFETY: samples_of(300, threads_at=threads_at)}
    assert row(record, "safety: threads, descriptors")[2] is fine


@pytest.mark.parametrize(("seconds", "fine"), [(151, False), (149, True)])
def test_the_longest_of_several_lives_counts(seconds: int, fine: bool) -> None:
    record = well()
    grows = samples_of(seconds, rss_per_s=MB / 10, threads_at=120, since_s=150)
    for lives in ([SAFETY, Life("safety", 11, 5)], [Life("safety", 11, 5), SAFETY]):
        record.lives = {one: samples_of(150) if one is SAFETY else grows for one in lives}
        assert row(record, "safety: memory")[2] is fine
        assert row(record, "safety: threads, descriptors")[2] is fine


def test_short_lives_beside_a_long_one_are_not_judged_and_alone_are_wrong() -> None:
    record = well()
    record.lives = {Life("safety", 9, 0): samples_of(20, rss_per_s=MB), SAFETY: samples_of(200)}
    assert row(record, "safety: memory")[2] is True
    del record.lives[SAFETY]
    assert row(record, "safety: memory")[1:] == ("no run was long enough", False)


# --- log, health, laps --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("log", "fine"),
    [
        ([(float(s), 500 * s) for s in range(300)], True),
        ([(float(s), 2100 * s) for s in range(300)], False),
        ([(float(s), 120_000 * (s > 100)) for s in range(300)], False),  # all at once
        ([(float(s), 0) for s in range(300)], False),  # no log lines
        ([(1.0, 300)], True),  # too short for a worst ten seconds
        ([], False),
    ],
)
def test_the_rate_of_the_log(log: list[tuple[float, int]], fine: bool) -> None:
    record = well()
    record.log = log
    assert row(record, "log")[2] is fine


@pytest.mark.parametrize(
    ("times", "fine"),
    [
        ([float(s) for s in range(300)], True),
        ([float(s) for s in range(300) if not 100 < s < 110], True),
        ([float(s) for s in range(300) if not 100 < s < 125], False),
        ([float(s) for s in range(270)], False),  # silent until the end
    ],
)
def test_a_service_that_falls_silent(times: list[float], fine: bool) -> None:
    record = well()
    record.health = {"safety": times}
    assert row(record, "safety: health")[2] is fine


@pytest.mark.parametrize(
    ("finished", "steps", "fine"),
    [
        (2, range(0, 300, 10), (True, True)),
        (1, range(0, 300, 10), (False, True)),
        (2, range(0, 210, 10), (True, False)),
        (2, [*range(0, 100, 10), *range(180, 300, 10)], (True, False)),
        (2, [], (True, False)),
    ],
)
def test_laps(finished: int, steps: list[int], fine: tuple[bool, bool]) -> None:
    record = well()
    record.progress = [Progress(s, "step") for s in steps]
    record.progress += [Progress(299.0, "lap finished")] * finished
    assert row(record, "laps finished")[2] is fine[0]
    assert row(record, "longest time without a step done")[2] is fine[1]


def test_what_broke_down_is_wrong() -> None:
    record = well()
    record.crashes, record.tracebacks = ["odom"], 1
    assert row(record, "crashes") == ("crashes", "odom", False)
    assert row(record, "tracebacks in the log")[2] is False


# --- standing -----------------------------------------------------------------------------------


def command(
    at_s: float, kind: motion.Command = RUN, linear: float = 0.5, angular: float = 0
) -> t.Command:
    return t.Command(mono_ns=round(at_s * NS_PER_S), kind=kind, linear=linear, angular=angular)


@pytest.mark.parametrize(
    ("one", "moving"),
    [
        (command(0), True),
        (command(0, linear=0, angular=-0.1), True),
        (command(0, linear=0), False),
        (command(0, kind=STOP), False),
        (command(0, kind=BRAKE), False),
    ],
)
def test_what_moves(one: t.Command, moving: bool) -> None:
    assert moves(one) is moving


@pytest.mark.parametrize(
    ("at_s", "late_s"), [(1.99, None), (2.0, 0.0), (2.5, 0.5), (2.999, 0.999), (3.0, None)]
)
def test_a_run_is_too_late_within_the_window_only(at_s: float, late_s: float | None) -> None:
    found = too_late([command(at_s)], Window("kill safety", 2 * NS_PER_S, 3 * NS_PER_S))
    assert [name for name, _ in found] == ([] if late_s is None else ["kill safety"])
    assert [late for _, late in found] == pytest.approx([] if late_s is None else [late_s])


def test_the_worst_of_what_moved_is_named() -> None:
    record = well()
    record.moved = [("kill safety", 0.5), ("driver fault", 0.75)]
    assert row(record, "RUN while it must stand") == (
        "RUN while it must stand", "2, 0.75 s too late after driver fault", False,
    )  # fmt: skip
