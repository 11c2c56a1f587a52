"""Tape, black box and the disk under them, without a bus."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from common.freshness import NS_PER_S
from common.sample import Sample
from common.settings import Vehicle
from services.recorder.blackbox import SLICE, BlackBox
from services.recorder.config import MB, Recorder
from services.recorder.mcap_codec import Translator
from services.recorder.reader import Reader
from services.recorder.rolling_writer import Tape
from services.recorder.storage import RETRY_NS, Shelf
from services.recorder.writer import Recording
from tests.recorder import samples
from tests.recorder.samples import BEGIN_NS, MONO_NS, sample

SETTINGS = Recorder(roll_size=1.0, roll_time=10.0, black_box=10.0, tail=2.0)


class Desk:
    """Begins files and notes those that have ended."""

    def __init__(self, folder: Path) -> None:
        self.shelf = Shelf(folder, 0)
        self.ended: list[Path] = []

    def begin(self, first: Sample, why: str) -> Recording:
        path = self.shelf.path("001", first.wall_ns, why)
        return Recording(path, Translator(Vehicle()), {"why": why})

    def end(self, recording: Recording) -> None:
        recording.close()
        self.ended.append(recording.path)

    def read(self) -> list[list[float]]:
        """Return the times of what is in each file, in seconds."""
        return [list(times(path)) for path in self.ended]


def times(path: Path) -> Iterator[float]:
    with Reader(path) as reader:
        yield from ((each.log_ns - BEGIN_NS) / NS_PER_S for each in reader)
    assert not reader.cut


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(tmp_path)


def at(second: float) -> Sample:
    return sample("tel/bridge/velocity", samples.velocity(), second)


def ns(second: float) -> int:
    return MONO_NS + round(second * NS_PER_S)


def test_a_tape_goes_on_in_a_new_file_after_its_time(desk: Desk) -> None:
    tape = Tape(SETTINGS, desk.begin, desk.end)
    tape.flush(ns(0))
    for second in range(25):
        tape.write(at(second))
        tape.flush(ns(second))
    tape.close()
    tape.close()
    assert desk.read() == [
        [float(second) for second in range(12)],
        [float(second) for second in range(12, 24)],
        [24.0],
    ]


def test_a_tape_goes_on_in_a_new_file_after_its_size(desk: Desk) -> None:
    tape = Tape(SETTINGS, desk.begin, desk.end)
    big = samples.bare("tel/x", bytes(range(256)) * 4000)
    for number in range(6):
        tape.write(big)
        tape.write(samples.bare("tel/x", number.to_bytes(64, "big")))
        tape.flush(ns(0))
    tape.close()
    assert sum(len(each) for each in desk.read()) == 12
    assert len(desk.ended) <= 6
    assert all(path.stat().st_size < 3 * MB for path in desk.ended)


def test_the_black_box_holds_the_minutes_before_and_the_tail(desk: Desk) -> None:
    box = BlackBox(SETTINGS, desk.begin, desk.end)
    box.write(ns(0))
    for second in range(30):
        box.keep(at(second))
        if second == 20:
            box.latched(["contact"], ns(20))
        box.write(ns(second))
        box.flush()
    assert [path.name for path in desk.ended] == ["001-20231114-221330-latch-contact.mcap"]
    assert desk.read() == [[float(second) for second in range(10, 23)]]


def test_what_latches_meanwhile_makes_it_longer_up_to_a_limit(desk: Desk) -> None:
    box = BlackBox(SETTINGS, desk.begin, desk.end)
    for second in range(30):
        box.keep(at(second))
        if second >= 5:
            box.latched(["contact"], ns(second))
            if desk.ended:
                break
        box.write(ns(second))
    assert desk.read() == [[float(second) for second in range(16)]]


def test_it_is_written_slice_by_slice(desk: Desk) -> None:
    box = BlackBox(SETTINGS, desk.begin, desk.end)
    for _ in range(3 * SLICE):
        box.keep(at(0))
    box.latched(["contact"], ns(0))
    for _ in range(3):
        assert desk.ended == []
        box.write(ns(5))
    assert [len(each) for each in desk.read()] == [3 * SLICE]


def test_the_end_of_the_process_writes_all_that_waits(desk: Desk) -> None:
    box = BlackBox(SETTINGS, desk.begin, desk.end)
    box.close()
    for second in range(3):
        box.keep(at(second))
    box.latched(["estop", "contact"], ns(2))
    box.close()
    assert desk.read() == [[0.0, 1.0, 2.0]]
    assert desk.ended[0].name.endswith("-latch-estop-contact.mcap")


def test_what_the_disk_does_not_take_is_dropped(desk: Desk) -> None:
    box = BlackBox(SETTINGS, desk.begin, desk.end)
    box.drop()
    for _ in range(SLICE + 5):
        box.keep(at(0))
    box.latched(["contact"], ns(0))
    box.write(ns(0))
    box.drop()
    assert [len(each) for each in desk.read()] == [SLICE]
    box.write(ns(9))
    assert len(desk.ended) == 1


def test_the_folder_is_made(tmp_path: Path) -> None:
    shelf = Shelf(tmp_path / "a" / "b", 0)
    shelf.look(0)
    assert shelf.has_room
    assert (tmp_path / "a" / "b").is_dir()


def test_names_tell_the_robot_and_when_and_why(tmp_path: Path) -> None:
    shelf = Shelf(tmp_path, 0)
    first = shelf.path("007", BEGIN_NS)
    assert first.name == "007-20231114-221320.mcap"
    first.touch()
    assert shelf.path("007", BEGIN_NS).name == "007-20231114-221320-1.mcap"
    assert shelf.path("007", BEGIN_NS, "latch-x").name == "007-20231114-221320-latch-x.mcap"


def test_room_ends_at_the_limit_and_comes_back_a_little_above(tmp_path: Path) -> None:
    left = [0]
    shelf = Shelf(tmp_path, 100 * MB, lambda _: left[0])
    found = []
    for free in (101, 100, 99, 100, 109, 111, 101):
        left[0] = free * MB
        shelf.look(0)
        found.append(shelf.has_room)
    assert found == [True, True, False, False, False, True, True]
    assert shelf.trouble == "109 MB are left, recorder.free is 100"


def test_a_disk_that_refuses_is_tried_again_later(tmp_path: Path) -> None:
    shelf = Shelf(tmp_path, 0)
    shelf.refused(OSError(28, "No space left on device"), 0)
    shelf.look(RETRY_NS - 1)
    assert not shelf.has_room
    assert shelf.trouble.endswith(": No space left on device")
    shelf.look(RETRY_NS)
    assert shelf.has_room


def test_a_folder_that_cannot_be_made_is_no_room(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    shelf = Shelf(tmp_path / "file" / "folder", 0)
    shelf.look(0)
    assert not shelf.has_room
    assert "file/folder" in shelf.trouble
