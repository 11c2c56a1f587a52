"""``t2 log`` of files, of folders, and of a real recorder."""

import os
import time
from collections.abc import Iterable
from pathlib import Path

import pytest
from msgspec.structs import replace

from cli.__main__ import main
from cli.recordings import log
from common.freshness import NS_PER_S
from common.settings import Vehicle
from services.recorder.mcap_codec import Encoder
from services.recorder.reader import Reader
from services.recorder.shift_log import ShiftLog, file_of
from services.recorder.writer import RecordingWriter
from t2.codec import Sample
from t2.messages import Event, EventName, Level, Phrase
from tests.recorder import samples
from tests.recorder.samples import BEGIN_NS, sample

NAMES = ("001-000001-20231114-221320.mcap", "001-000002-20231114-221820-latch-estop.mcap")
HOSTILE = "\x1b[31mAnn\n" + "x" * 300


@pytest.fixture(autouse=True)
def _utc(monkeypatch: pytest.MonkeyPatch) -> Iterable[None]:
    monkeypatch.setenv("TZ", "UTC")
    monkeypatch.setenv("T2_LANG", "en")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def event(
    at_s: float,
    service: str,
    name: EventName,
    *phrases: Phrase,
    level: Level = "info",
    **about: str,
) -> Sample:
    made = Event(
        seq=round(at_s * 10), boot=5, name=name, level=level, text="", phrases=phrases,
        about=dict(about),
    )  # fmt: skip
    return sample(f"evt/{service}", made, at_s)


def night(robot: str = "001", by: str = "Ann") -> list[Sample]:
    """Return an emergency stop, its reset, a take-over and a round in 10 minutes."""
    states = [sample("tel/safety/state", samples.state(), at) for at in range(0, 600, 2)]
    streams = [sample("tel/bridge/velocity", samples.velocity(), at + 0.5) for at in range(600)]
    events = [
        event(99.5, "dashboard", "estop", Phrase("event.estop", {"by": by}), by=by),
        event(100, "safety", "estop", Phrase("estop"), level="error", cause="estop"),
        event(199, "teleop", "reset_request", Phrase("event.reset_request", {"by": "Bob"})),
        event(200, "safety", "reset", Phrase("reset.done")),
        event(300, "dashboard", "take_over",
              Phrase("event.take_over", {"by": "Cy", "other": "Bob"}), by="Cy", other="Bob"),
        event(400, "patrol", "round_start", Phrase("patrol.announcing", {"route": "yard"})),
        event(500, "patrol", "round_end", Phrase("patrol.home")),
    ]  # fmt: skip
    found = sorted([*states, *streams, *events], key=lambda one: one.received_ns)
    return [replace(one, key=one.key.replace("/001/", f"/{robot}/")) for one in found]


def written(file: Path, given: Iterable[Sample], *, is_cut: bool = False) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    writer = RecordingWriter(file, Encoder(Vehicle()))
    for number, one in enumerate(given):
        writer.write(one)
        if number % 20 == 0:
            writer.flush()  # many chunks
    writer.flush()
    size = file.stat().st_size
    writer.close()
    if is_cut:
        os.truncate(file, size - 10)
    return file


def lines(capsys: pytest.CaptureFixture[str], *words: str | Path) -> list[str]:
    """Return the lines of the output."""
    assert main(["log", *map(str, words)]) == 0
    return capsys.readouterr().out.splitlines()


NIGHT = [
    "begin                end       kind       what",
    "2023-11-14 22:15:00  22:16:40  stop       Emergency stop by Ann. Reset by Bob.",
    "2023-11-14 22:18:20            take-over  Cy takes control from Bob.",
    "2023-11-14 22:20:00  22:21:40  round      Round on yard. "
    "The round is complete, and the vehicle is at home.",
]


def test_a_recording_in_both_languages(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file = written(tmp_path / NAMES[0], night())
    assert lines(capsys, file) == NIGHT
    monkeypatch.setenv("T2_LANG", "zh")
    shown = lines(capsys, file)
    assert shown[0].split() == ["开始", "结束", "类别", "内容"]
    assert "Ann 触发了急停。Bob 已复位。" in shown[1]


def test_a_black_box_beside_a_recording_adds_no_rows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written(tmp_path / NAMES[0], night())
    written(tmp_path / "deeper" / NAMES[1], night()[50:300])
    assert len(lines(capsys, tmp_path)) == 1 + len(NIGHT)  # and the day before it


def test_a_cut_recording_and_a_gap_until_the_next_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written(tmp_path / NAMES[0], night()[:340], is_cut=True)
    later = [replace(one, wall_ns=one.wall_ns + 7200 * NS_PER_S) for one in night()]
    written(tmp_path / "001-000003-20231115-001320.mcap", later[:100])
    shown = lines(capsys, tmp_path, "--since", "2023-11-14 22:13:20")
    assert shown[1:] == [
        "2023-11-14 22:15:00  22:16:40             stop  Emergency stop by Ann. Reset by Bob.",
        "2023-11-14 22:17:02  2023-11-15 00:13:20  gap   "
        "NOT RECORDED: the recorder was off, or received nothing from safety.",
    ]


def test_several_robots_and_a_hostile_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written(tmp_path / NAMES[0], night())
    written(tmp_path / "002-000001-20231114-221320.mcap", night("002", HOSTILE))
    shown = "\n".join(lines(capsys, *tmp_path.iterdir()))
    assert (
        r"  002  2023-11-14 22:15:00  22:16:40  stop       Emergency stop by \u001b[31mAnn\nxxx"
        in shown
    )
    assert "\x1b" not in shown
    assert max(map(len, shown.splitlines())) < 200
    assert not [each for each in lines(capsys, tmp_path, "--robot", "001") if "\\u001b" in each]


def test_only_the_chunks_with_events_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = written(tmp_path / NAMES[0], night())
    with Reader(file) as whole:
        total = len(list(whole))
    unpacked: list[int] = []
    unpack = Reader._unpacked

    def counted(self: Reader, record: object) -> object:
        found = unpack(self, record)  # type: ignore[arg-type]
        unpacked.append(len(found))
        return found

    monkeypatch.setattr(Reader, "_unpacked", counted)
    with Reader(file) as reader:
        found = list(reader.selected(log.is_event))
        assert reader.is_indexed
    assert len(found) == 7
    assert sum(unpacked) < total / 3


def test_old_recordings_are_skipped_by_their_names(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "001-000001-20231101-000000.mcap").write_bytes(b"not read")
    written(tmp_path / NAMES[0], night())
    assert main(["log", str(tmp_path)]) == 0
    assert "is not an MCAP file" not in capsys.readouterr().err
    assert main(["log", str(tmp_path), "--days", "30"]) == 0
    captured = capsys.readouterr()
    assert "is not an MCAP file" in captured.err
    assert "NOT RECORDED" in captured.out.splitlines()[1]


def test_a_shift_log_and_the_recordings_beside_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = ShiftLog(file_of(tmp_path, "001"), "001", 1)
    for at_s in range(0, 500, 4):
        made.update(at_s * NS_PER_S, BEGIN_NS + at_s * NS_PER_S)
    made.mark()
    made.write()
    written(tmp_path / NAMES[0], night())
    assert len(lines(capsys, *tmp_path.iterdir())) == len(NIGHT)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("{}",), "has no recordings"),
        (("{}/none.mcap",), "cannot be read"),
        (("{}", "--since", "tomorrow"), "is no time: write 2026-11-28"),
        (("{}", "--days", "0"), "must be more than 0"),
    ],
)
def test_what_cannot_be_read_is_named(
    words: tuple[str, ...], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code = main(["log", *(word.format(tmp_path) for word in words)])
    except SystemExit as end:
        code = int(str(end.code))
    assert code in (1, 2)
    assert message in capsys.readouterr().err


def test_a_time_is_local_and_may_have_an_hour() -> None:
    assert log.moment("2023-11-14 22:13:20") == BEGIN_NS
    assert log.moment("2023-11-14") < BEGIN_NS
    assert log.moment("2023-11-14T22:13:20+00:00") == BEGIN_NS


def test_nothing_is_claimed_of_what_is_not_recorded(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = ShiftLog(file_of(tmp_path, "001"), "001", 1)
    for at_s in range(10):
        made.update(at_s * NS_PER_S, BEGIN_NS + at_s * NS_PER_S)
    made.mark()
    made.write()
    assert main(["log", str(file_of(tmp_path, "001"))]) == 0
    assert "nothing happened" in capsys.readouterr().err
    for words, reason in (
        (["--robot", "002"], "nothing of robot 002 is recorded here, only of 001"),
        (["--since", "2030-01-01"], "no state of safety of that time is recorded here"),
    ):
        assert main(["log", str(tmp_path), *words]) == 1
        assert reason in capsys.readouterr().err
    file_of(tmp_path, "001").write_bytes(b"")
    assert main(["log", str(tmp_path)]) == 1
