"""The schedule: time zones, changes of the clock, and rounds that are late."""

from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

from services.patrol.config import ScheduledRound
from services.patrol.schedule import Due, Schedule

BERLIN = ZoneInfo("Europe/Berlin")
NIGHT = {"night": ScheduledRound(route="yard", cron="30 2 * * *")}


def times(schedule: Schedule, begin: datetime, hours: float) -> list[datetime]:
    """Return when rounds are due; each second of the monotonic clock is one of the wall clock."""
    found, now = [], begin.astimezone(UTC)
    for second in range(0, round(hours * 3600), 20):
        for due in schedule.due(now + timedelta(seconds=second), second):
            found.append(now + timedelta(seconds=second - due.late_s))
    return found


def test_a_round_is_due_once_at_its_time() -> None:
    begin = datetime(2026, 6, 1, 20, 0, tzinfo=BERLIN)
    schedule = Schedule(NIGHT, BERLIN, begin)
    assert schedule.next == ("night", "yard", datetime(2026, 6, 2, 2, 30, tzinfo=BERLIN))
    assert times(schedule, begin, 48) == [
        datetime(2026, 6, 2, 2, 30, tzinfo=BERLIN), datetime(2026, 6, 3, 2, 30, tzinfo=BERLIN),
    ]  # fmt: skip


def test_half_past_two_in_the_nights_of_the_clock_change() -> None:
    spring = datetime(2026, 3, 28, 20, 0, tzinfo=BERLIN)
    found = times(Schedule(NIGHT, BERLIN, spring), spring, 24)
    assert found == [datetime(2026, 3, 29, 3, 0, tzinfo=BERLIN)]  # there is no 2:30
    autumn = datetime(2026, 10, 24, 20, 0, tzinfo=BERLIN)
    found = times(Schedule(NIGHT, BERLIN, autumn), autumn, 24)
    assert len(found) == 1  # there are two


def test_a_clock_that_jumps_forward_makes_a_round_late() -> None:
    begin = datetime(2026, 6, 1, 20, 0, tzinfo=UTC)
    schedule = Schedule(NIGHT, UTC, begin)
    assert schedule.due(begin, 0.0) == []
    (due,) = schedule.due(begin + timedelta(hours=8), 1.0)
    assert due == Due("night", "yard", 90 * 60)
    assert schedule.due(begin + timedelta(hours=8, seconds=1), 2.0) == []


def test_a_clock_that_jumps_backward_repeats_no_round_that_has_just_begun() -> None:
    begin = datetime(2026, 6, 1, 2, 29, tzinfo=UTC)
    schedule = Schedule(NIGHT, UTC, begin)
    at = begin + timedelta(minutes=1)
    assert len(schedule.due(at, 60.0)) == 1
    back = at - timedelta(minutes=10)
    assert schedule.due(back, 61.0) == []
    assert schedule.due(at, 661.0) == []
    assert len(schedule.due(at + timedelta(days=1), 87_000.0)) == 1


def test_a_clock_that_was_wrong_by_hours_starts_the_round_at_the_right_time() -> None:
    wrong = datetime(2026, 6, 1, 10, 29, tzinfo=UTC)
    rows = {"noon": ScheduledRound(route="yard", cron="30 10 * * *")}
    schedule = Schedule(rows, UTC, wrong)
    assert len(schedule.due(wrong + timedelta(minutes=1), 60.0)) == 1
    right = wrong - timedelta(hours=8)
    assert schedule.due(right, 120.0) == []
    assert len(schedule.due(right + timedelta(hours=8, minutes=1), 120.0 + 8 * 3600)) == 1


def test_two_schedules_at_one_time_are_both_due() -> None:
    rows = {name: ScheduledRound(route=name, cron="0 22 * * *") for name in ("yard", "hall")}
    begin = datetime(2026, 6, 1, 21, 59, 30, tzinfo=UTC)
    due = Schedule(rows, UTC, begin).due(begin + timedelta(seconds=31), 31.0)
    assert [each.route for each in due] == ["yard", "hall"]


def test_a_date_that_never_comes_is_no_round() -> None:
    rows = {"never": ScheduledRound(route="yard", cron="0 0 30 2 1-5")}
    schedule = Schedule(rows, UTC, datetime(2026, 6, 1, tzinfo=UTC))
    assert schedule.next is None or schedule.next[2].year > 2026
    assert Schedule({}, UTC, datetime(2026, 6, 1, tzinfo=UTC)).next is None
