"""Which recordings are removed when the disk is full, and which never are."""

import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from common.settings import Vehicle
from services.recorder.config import MB
from services.recorder.mcap_codec import Translator
from services.recorder.retention import Stored, removable, to_remove
from services.recorder.storage import Shelf
from services.recorder.writer import Recording

OLD, MIDDLE, NEW = "001-20260101-000000", "001-20260201-000000", "001-20260301-000000"
TAPES = [f"{stamp}.mcap" for stamp in (OLD, MIDDLE, NEW)]
LATCHES = [f"{stamp}-latch-contact.mcap" for stamp in (OLD, MIDDLE, NEW)]


def stored(*names: str, kept: tuple[str, ...] = ()) -> list[Stored]:
    return [Stored(name, MB, name in kept) for name in names]


def names(files: list[Stored]) -> list[str]:
    return [file.name for file in files]


def test_continuous_files_go_before_incidents_and_the_newest_of_each_stays() -> None:
    files = stored(*reversed(TAPES), *reversed(LATCHES))
    assert names(removable(files, "001")) == [*TAPES[:2], *LATCHES[:2]]


def test_what_is_kept_stays() -> None:
    files = stored(*TAPES, *LATCHES, kept=(TAPES[0], LATCHES[1]))
    assert names(removable(files, "001")) == [TAPES[1], LATCHES[0]]


def test_a_kept_newest_protects_no_other() -> None:
    files = stored(*LATCHES, kept=(LATCHES[2],))
    assert names(removable(files, "001")) == LATCHES[:2]


def test_files_of_one_second_go_in_the_order_of_their_numbers() -> None:
    same = [f"{OLD}.mcap", *(f"{OLD}-{n}.mcap" for n in (1, 2, 10))]
    assert names(removable(stored(*reversed(same)), "001")) == same[:3]
    latches = [f"{OLD}-latch-a-b.mcap", *(f"{OLD}-latch-a-b-{n}.mcap" for n in (2, 10))]
    assert names(removable(stored(*reversed(latches)), "001")) == latches[:2]


@pytest.mark.parametrize(
    "name",
    [f"lap-{OLD}.mcap", f"{OLD}.html", f"{OLD}.mcap.keep", f"{OLD}-lap.mcap", "001.mcap",
     f"002{OLD[3:]}.mcap", f"{OLD}-latch-.mcap", f"0011{OLD[3:]}.mcap", ""],
)  # fmt: skip
def test_a_name_that_the_recorder_did_not_give_is_never_touched(name: str) -> None:
    assert removable(stored(name, f"a{name}", *TAPES[1:]), "001") == stored(TAPES[1])


def test_no_more_goes_than_is_wanted() -> None:
    files = stored(*TAPES, *LATCHES)
    assert names(to_remove(files, "001", 1, 1)) == TAPES[:1]
    assert names(to_remove(files, "001", 1, MB)) == TAPES[:1]
    assert names(to_remove(files, "001", 1, MB + 1)) == TAPES[:2]
    assert names(to_remove(files, "001", 4 * MB, 9 * MB)) == [*TAPES[:2], *LATCHES[:2]]


def test_nothing_goes_when_all_would_not_be_enough() -> None:
    files = stored(*TAPES, *LATCHES)
    assert to_remove(files, "001", 4 * MB + 1, 9 * MB) == []
    assert to_remove([], "001", 0, 0) == []


class Disk:
    """A folder with so many bytes for recordings."""

    def __init__(self, folder: Path, room: int, *files: str) -> None:
        self.folder, self.room = folder, room
        for name in files:
            (folder / name).write_bytes(bytes(MB))

    def free(self, folder: Path) -> int:
        return self.room - sum(path.stat().st_size for path in folder.iterdir())

    def names(self) -> list[str]:
        return sorted(path.name for path in self.folder.iterdir())


def test_room_is_made_a_little_above_the_limit(tmp_path: Path) -> None:
    disk = Disk(tmp_path, 15 * MB, *TAPES, *LATCHES)
    shelf = Shelf(tmp_path, 10 * MB, disk.free, robot="001")
    assert names(shelf.look(0)) == TAPES[:2]
    assert shelf.has_room
    assert shelf.look(0) == []
    disk.room -= 2 * MB
    assert names(shelf.look(0)) == LATCHES[:2]
    assert shelf.has_room
    assert disk.names() == sorted([TAPES[2], LATCHES[2]])
    disk.room -= 3 * MB
    assert shelf.look(0) == []
    assert not shelf.has_room


def test_room_that_comes_short_of_a_little_above_is_room(tmp_path: Path) -> None:
    disk = Disk(tmp_path, 15 * MB, *TAPES)
    shelf = Shelf(tmp_path, 14 * MB, disk.free, robot="001")
    shelf.has_room = False
    assert names(shelf.look(0)) == TAPES[:2]
    assert shelf.has_room


def test_a_file_with_a_mark_beside_it_stays(tmp_path: Path) -> None:
    disk = Disk(tmp_path, 12 * MB, *LATCHES)
    (tmp_path / f"{LATCHES[0]}.keep").touch()
    Shelf(tmp_path, 10 * MB, disk.free, robot="001").look(0)
    assert disk.names() == sorted([LATCHES[0], LATCHES[2], f"{LATCHES[0]}.keep"])


def test_a_file_that_is_being_written_stays(tmp_path: Path) -> None:
    disk = Disk(tmp_path, 12 * MB, *TAPES[1:])
    writing = Recording(tmp_path / TAPES[0], Translator(Vehicle()), {})
    Shelf(tmp_path, 10.5 * MB, disk.free, robot="001").look(0)
    assert disk.names() == [TAPES[0], TAPES[2]]
    writing.close()


def test_what_this_process_began_last_is_the_newest_whatever_its_clock(tmp_path: Path) -> None:
    disk = Disk(tmp_path, 12 * MB, *LATCHES)
    shelf = Shelf(tmp_path, 10 * MB, disk.free, robot="001")
    began = shelf.path("001", 0, "latch-estop")  # a clock at 1970
    began.write_bytes(bytes(MB))
    shelf.look(0)
    assert began.exists()
    assert disk.names() == sorted([began.name, LATCHES[2]])


def test_without_a_robot_nothing_is_removed(tmp_path: Path) -> None:
    disk = Disk(tmp_path, 15 * MB, *TAPES, *LATCHES)
    shelf = Shelf(tmp_path, 10 * MB, disk.free)
    assert shelf.look(0) == []
    assert not shelf.has_room


def test_a_file_that_cannot_be_removed_is_no_more_than_no_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = Disk(tmp_path, 12 * MB, *TAPES)

    def refuse(_: Path, *, missing_ok: bool) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(Path, "unlink", refuse)
    shelf = Shelf(tmp_path, 10 * MB, disk.free, robot="001")
    assert shelf.look(0) == []
    assert not shelf.has_room
    assert disk.names() == TAPES


def test_a_file_that_vanishes_meanwhile_is_no_trouble(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / TAPES[0]).symlink_to("nowhere")
    disk = Disk(tmp_path, 12 * MB, *TAPES[1:])
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=9 * MB))
    assert names(Shelf(tmp_path, 10 * MB, robot="001").look(0)) == TAPES[1:2]
    assert disk.names() == [TAPES[0], TAPES[2]]
