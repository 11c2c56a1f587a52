"""The file of the shift log."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S
from services.recorder import shift, shift_log
from services.recorder.shift_log import RATE_MAX, ShiftLog, file_of, history, read_lines
from t2.messages import Event, EventName, LogRequest, Phrase
from tests.recorder import samples

BEGIN_NS = 1_700_000_000 * NS_PER_S
BOOT, NEXT_BOOT = 11, 12


class Clock:
    """Time since boot and wall clock; the latter is wrong by ``error_s``."""

    def __init__(self, log: ShiftLog, up_s: float = 100.0, error_s: float = 0.0) -> None:
        self.log, self.up_s, self.error_s = log, up_s, error_s

    @property
    def now(self) -> tuple[int, int]:
        wall_ns = BEGIN_NS + round((self.up_s + self.error_s) * NS_PER_S)
        return round(self.up_s * NS_PER_S), wall_ns

    def hear(self, seconds: float) -> None:
        """Let states of safety arrive for some seconds."""
        until_s = self.up_s + seconds
        while self.up_s < until_s:
            self.log.update(*self.now)
            self.up_s += 1.0

    def note(self, name: EventName = "contact", seq: int = 1, service: str = "safety") -> None:
        event = Event(
            name=name, level="error", text="Hit.", phrases=(Phrase("contact"),), boot=1, seq=seq
        )
        self.log.note(service, event, *self.now)

    def rows(self) -> list[tuple[str, float, float]]:
        """Return kind, begin and end of each row, in s of a right clock, the oldest first."""

        def seconds(ns: int) -> float:
            return (ns - BEGIN_NS) / NS_PER_S if ns else 0.0

        found = self.log.reply(LogRequest(), *self.now).rows[::-1]
        return [(row.kind, seconds(row.t_ns), seconds(row.end_ns)) for row in found]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return file_of(tmp_path / "new", "001")


def log_of(file: Path, boot: int = BOOT) -> ShiftLog:
    return ShiftLog(file, "001", boot)


def test_rows_are_read_from_the_file_and_from_what_is_not_written_yet(file: Path) -> None:
    clock = Clock(log_of(file))
    clock.hear(5)
    clock.note()
    assert clock.rows() == [("stop", 105.0, 0.0)]
    clock.log.write()
    assert clock.rows() == [("stop", 105.0, 0.0)]
    assert shift_log.robot_of(file) == "001"
    assert clock.log.reply(LogRequest(), *clock.now).rows[0].robot == "001"


def test_an_event_that_is_received_again_is_known_and_has_its_own_time(file: Path) -> None:
    """Publishers keep events: they come once more after a restart, and late after a cut."""
    clock = Clock(log_of(file))
    clock.hear(10)
    own = Event(
        name="contact", level="error", text="Hit.", boot=1, seq=1, host=BOOT,
        mono_ns=104 * NS_PER_S,
    )  # fmt: skip
    clock.log.note("safety", own, *clock.now)
    before = replace(own, seq=2, mono_ns=20 * NS_PER_S)  # not in this run of safety
    other = replace(own, seq=3, host=99, mono_ns=1)  # another computer's clock
    clock.log.note("safety", before, *clock.now)
    clock.log.note("safety", other, *clock.now)
    assert [row for row in clock.rows() if row[0] == "stop"] == [
        ("stop", 20.0, 0.0), ("stop", 104.0, 0.0), ("stop", 110.0, 0.0)
    ]  # fmt: skip
    clock.log.write()
    size = file.stat().st_size
    again = log_of(file)
    for event in (own, before, other):
        clock.log.note("safety", event, *clock.now)
        again.note("safety", event, *clock.now)
    for log in (clock.log, again):
        log.write()
    assert file.stat().st_size == size


def test_a_reply_is_a_page_of_the_newest_rows(file: Path) -> None:
    clock = Clock(log_of(file))
    for seq in range(5):
        clock.hear(10)
        clock.note(seq=seq)
    first = clock.log.reply(LogRequest(most=2), *clock.now)
    assert [row.t_ns for row in first.rows] == [clock.now[1], clock.now[1] - 10 * NS_PER_S]
    assert first.more
    rest = clock.log.reply(LogRequest(before_ns=first.rows[-1].t_ns), *clock.now)
    assert (len(rest.rows), rest.more) == (3, False)
    since_ns = clock.now[1] - 5 * NS_PER_S
    assert len(clock.log.reply(LogRequest(since_ns=since_ns), *clock.now).rows) == 1


def test_a_power_loss_leaves_a_gap_and_a_cut_line(file: Path) -> None:
    clock = Clock(log_of(file))
    clock.hear(130)  # marks at 100, 160 and 220
    clock.note()
    clock.log.write()
    with file.open("ab") as cut:
        cut.write(b'{"host":11,"since_n')
    after = Clock(log_of(file, NEXT_BOOT), up_s=20.0, error_s=1000.0)  # the right time: 1020
    after.note(seq=2)
    after.log.write()
    after.hear(3)
    assert after.rows() == [("stop", 230.0, 0.0), ("gap", 230.0, 1020.0), ("stop", 1020.0, 0.0)]


def test_a_silent_safety_is_a_gap_although_the_recorder_runs(file: Path) -> None:
    clock = Clock(log_of(file))
    clock.hear(10)
    clock.up_s += 3600.0
    assert clock.rows() == [("gap", 109.0, 3710.0)]
    clock.note()
    clock.up_s += 1.0
    clock.hear(10)
    clock.log.write()
    # An event is no state of safety.
    assert clock.rows() == [("gap", 109.0, 3711.0), ("stop", 3710.0, 0.0)]


def test_a_clock_that_was_set_corrects_the_lines_of_its_boot(file: Path) -> None:
    before = Clock(log_of(file))
    before.hear(10)
    before.log.mark()
    before.log.write()
    clock = Clock(log_of(file, NEXT_BOOT), up_s=10.0, error_s=-1e9)
    clock.hear(10)
    clock.note()
    clock.log.write()
    clock.error_s = 190.0  # the network has set it: up 20 s is 210
    assert clock.rows() == [("gap", 109.0, 200.0), ("stop", 210.0, 0.0)]


def test_a_disk_that_refuses_is_tried_again(file: Path) -> None:
    clock = Clock(log_of(file))
    file.parent.write_text("no folder")
    clock.hear(3)
    clock.note()
    with pytest.raises(OSError, match="exists"):
        clock.log.write()
    file.parent.unlink()
    clock.log.write()
    assert [line.service for line in read_lines(file)] == ["", "safety"]


def test_a_flood_of_events_is_counted_and_others_are_logged(file: Path) -> None:
    clock = Clock(log_of(file))
    for seq in range(RATE_MAX + 7):
        clock.note("estop", seq, "dashboard")
    clock.note()
    clock.note("slip", service="odom")  # not of the shift log
    clock.log.write()
    assert clock.log.take_dropped() == 7
    assert clock.log.take_dropped() == 0
    assert len(list(read_lines(file))) == RATE_MAX + 1


def test_a_long_event_is_cut(file: Path) -> None:
    log, text = log_of(file), "x" * 4000
    phrases = tuple(Phrase("log.text", {"text": text}) for _ in range(100))
    event = Event(name="estop", level="error", text=text, phrases=phrases, about={"by": text})
    log.note("dashboard", event, 5, BEGIN_NS)
    log.write()
    assert file.stat().st_size < 1000
    (line,) = read_lines(file)
    assert line.event is not None
    assert len(str(line.event.about["by"])) == 60


def test_a_large_file_keeps_its_newest_events_and_their_times(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shift_log, "SIZE_MAX", 20_000)
    clock = Clock(log_of(file))
    for seq in range(500):
        clock.hear(120)
        clock.note(seq=seq)
        clock.log.take_dropped()
        clock.log.write()
        assert file.stat().st_size < 21_000
    seen, spans = history(read_lines(file))
    newest = [one.event.seq for one in seen]
    assert newest == list(range(newest[0], 500))
    assert len(newest) > 20
    assert len(spans) == 1
    # What was removed counts as not recorded, also after the next lines.
    assert spans[0].begin_ns == min(line.t_ns for line in read_lines(file))
    clock.hear(120)
    clock.log.write()
    assert history(read_lines(file))[1][0].begin_ns == spans[0].begin_ns
    clock.up_s += 3600.0
    clock.hear(200)  # without an event
    clock.log.mark()
    monkeypatch.setattr(shift_log, "SIZE_MAX", file.stat().st_size)
    clock.log.write()
    _, (*_, quiet) = history(read_lines(file))
    assert quiet.end_ns - quiet.begin_ns == 199 * NS_PER_S
    clock.up_s -= 1.0
    assert [kind for kind, *_ in clock.rows() if kind == "gap"] == ["gap"]


def test_what_safety_has_latched_is_a_stop_without_its_event(file: Path) -> None:
    clock = Clock(log_of(file))
    clock.hear(10)
    state = samples.state("estop_reader")
    for _ in range(2):  # the state, and later safety's own event
        clock.log.note("safety", shift.latch(state, "estop_reader"), *clock.now)
        clock.hear(1)
    clock.hear(10)
    clock.log.note("safety", shift.latch(state, "driver_left"), *clock.now)
    assert [kind for kind, *_ in clock.rows()] == ["stop", "stop"]


def test_frequent_stops_push_no_latch_out(file: Path) -> None:
    clock = Clock(log_of(file))
    clock.hear(10)
    for seq in range(100):
        idle = Event(name="stop", level="info", text="", about={"cause": "no_request"}, seq=seq)
        late = Event(name="stop", level="warning", text="Old.", about={"cause": "silent"}, seq=seq)
        clock.log.note("safety", idle, *clock.now)
        clock.log.note("safety", late, *clock.now)
    clock.note()
    found = [row.text for row in clock.log.reply(LogRequest(most=500), *clock.now).rows]
    assert "The bumper was hit. No reset is recorded." in found
    assert clock.log.take_dropped() == 70


def test_rows_of_one_time_are_on_one_page(file: Path) -> None:
    clock = Clock(log_of(file))
    clock.hear(10)
    for seq in range(7):
        clock.note("estop_unconfirmed", seq=seq, service="dashboard")
    page = clock.log.reply(LogRequest(most=2), *clock.now)
    assert (len(page.rows), page.more) == (7, False)


def test_times_that_no_clock_has_are_skipped(file: Path) -> None:
    clock = Clock(log_of(file))
    clock.hear(10)
    clock.log.write()
    with file.open("ab") as damaged:
        damaged.write(b'{"host":11,"since_ns":1,"up_ns":2,"t_ns":%d}\n' % 10**30)
    after = Clock(log_of(file), up_s=110.0)
    after.hear(1)
    assert after.rows() == []


def test_lines_that_the_disk_never_took_are_reported(file: Path) -> None:
    clock = Clock(log_of(file))
    for seq in range(shift_log.WAITING_MAX + 5):
        clock.hear(2)
        clock.note(seq=seq)
    assert clock.log.take_dropped() >= 5
