"""Statuses by name; silent ones are stale."""

from services.ros2.diagnostics import STALE, STALE_NS, Diagnostics
from services.ros2.translate import OK, WARN, status


class Clock:
    """A clock that the test sets."""

    now_ns = 1_000

    def __call__(self) -> int:
        return self.now_ns


def test_the_newest_status_of_each_name_in_order() -> None:
    diagnostics = Diagnostics(Clock())
    diagnostics.note(status(OK, "safety", "one", {}))
    diagnostics.note(status(OK, "link", "two", {"a": 1}))
    diagnostics.note(status(WARN, "safety", "three", {}))
    assert diagnostics.statuses(1_000) == (
        status(OK, "link", "two", {"a": 1}),
        status(WARN, "safety", "three", {}),
    )


def test_a_silent_part_is_stale() -> None:
    clock = Clock()
    diagnostics = Diagnostics(clock)
    diagnostics.note(status(OK, "link", "Up.", {"a": 1}))
    clock.now_ns += STALE_NS
    diagnostics.note(status(OK, "safety", "Runs.", {}))
    assert [each[0] for each in diagnostics.statuses(clock.now_ns)] == [OK, OK]
    link, safety = diagnostics.statuses(clock.now_ns + 1)
    assert link == (STALE, "t2: link", "Silent. Last: Up.", "t2", (("a", "1"),))
    assert safety == status(OK, "safety", "Runs.", {})


def test_the_decision_about_commands_is_noted_on_a_change_only() -> None:
    clock = Clock()
    diagnostics = Diagnostics(clock)
    diagnostics.note(status(OK, "cmd_vel", "Taken.", {}))
    (kept,) = diagnostics.statuses(clock.now_ns + 10 * STALE_NS)
    assert kept == status(OK, "cmd_vel", "Taken.", {})
