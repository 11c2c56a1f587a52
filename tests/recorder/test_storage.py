"""File names, free space and removal of old recordings."""

from pathlib import Path

import pytest

from common.freshness import NS_PER_S
from common.settings import Vehicle
from services.recorder.mcap_codec import Encoder
from services.recorder.storage import MB, RETRY_NS, Storage, StoredFile, removable, to_remove
from services.recorder.writer import RecordingWriter
from tests.recorder.files_fixture import CONTINUOUS, INCIDENTS, OLD, UNNUMBERED, names, stored
from tests.recorder.samples import BEGIN_NS


def test_file_names_hold_robot_number_time_and_reason(tmp_path: Path) -> None:
    storage = Storage(tmp_path, 0)
    first = storage.new_path("007", BEGIN_NS)
    assert first.name == "007-000001-20231114-221320.mcap"
    first.touch()
    for foreign in ("007-20260101-000000-9.mcap", "008-000009-20260101-000000.mcap", "7.mcap"):
        (tmp_path / foreign).touch()
    assert storage.new_path("007", BEGIN_NS).name == "007-000002-20231114-221320.mcap"
    later = Storage(tmp_path, 0)  # of another start, and with an earlier clock
    assert later.new_path("007", 0, "latch-x").name == "007-000002-19700101-000000-latch-x.mcap"


def test_a_clock_that_starts_in_the_past_does_not_order_the_files(tmp_path: Path) -> None:
    made = [f"{UNNUMBERED}-latch-contact-{copy}.mcap" for copy in (1, 2)]
    disk = Disk(tmp_path, 20 * MB, *made)
    for years in (56.2, 49.1, 49.2, 0.0):  # since 1970, each by another start of the recorder
        storage = Storage(tmp_path, 0, disk.free, robot="001")
        path = storage.new_path("001", round(years * 31_557_600) * NS_PER_S, "latch-contact")
        path.write_bytes(bytes(MB))
        made.append(path.name)
    for left in (4, 3, 2, 1):
        disk.room = round((left + 2.3) * MB)
        Storage(tmp_path, 2 * MB, disk.free, robot="001").check(0)
        assert disk.names() == sorted(made[-left:])


def test_files_without_a_number_are_ordered_by_their_last_write() -> None:
    early, late = (f"001-{year}0101-000000-latch-contact.mcap" for year in (2026, 2019))
    numbered = "001-000001-19700101-000000-latch-contact.mcap"
    files = [
        StoredFile(numbered, MB),
        StoredFile(late, MB, written_ns=2),
        StoredFile(early, MB, written_ns=1),
    ]
    assert names(removable(files, "001")) == [early, late]


def test_free_space_limit_has_a_hysteresis(tmp_path: Path) -> None:
    left = [0]
    storage = Storage(tmp_path, 100 * MB, lambda _: left[0])
    found = []
    for free in (101, 100, 99, 100, 109, 111, 101):
        left[0] = free * MB
        storage.check(0)
        found.append(storage.has_room)
    assert found == [True, True, False, False, False, True, True]
    assert storage.problem == "109 MB are left, recorder.free is 100"


def test_retry_after_a_disk_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    storage = Storage(tmp_path / "file" / "folder", 0)
    storage.check(0)
    assert storage.problem.endswith("file/folder: Not a directory")
    (tmp_path / "file").unlink()
    found = []
    for at_ns in (RETRY_NS - 1, RETRY_NS):
        storage.check(at_ns)
        found.append(storage.has_room)
    assert found == [False, True]
    assert storage.folder.is_dir()


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


def test_room_is_made_with_hysteresis(tmp_path: Path) -> None:
    disk = Disk(tmp_path, 15 * MB, *CONTINUOUS, *INCIDENTS)
    storage = Storage(tmp_path, 10 * MB, disk.free, robot="001")
    assert names(storage.check(0)) == CONTINUOUS[:2]
    assert storage.has_room
    assert storage.check(0) == []
    disk.room -= 2 * MB
    assert names(storage.check(0)) == INCIDENTS[:2]
    assert storage.has_room
    assert disk.names() == sorted([CONTINUOUS[2], INCIDENTS[2]])
    disk.room -= 3 * MB
    assert storage.check(0) == []
    assert not storage.has_room


def test_a_marked_file_and_the_latest_of_this_process_stay(tmp_path: Path) -> None:
    disk = Disk(tmp_path, 13 * MB, *INCIDENTS)
    mark = f"{INCIDENTS[0]}.keep"
    (tmp_path / mark).touch()
    storage = Storage(tmp_path, 10 * MB, disk.free, robot="001")
    began = storage.new_path("001", 0, "latch-estop")  # a clock at 1970
    began.write_bytes(bytes(MB))
    later = INCIDENTS[2].replace("000003", "000005")  # of another recorder
    (tmp_path / later).write_bytes(bytes(MB))
    storage.check(0)
    assert disk.names() == sorted([began.name, INCIDENTS[0], later, mark])


def test_a_file_that_any_process_writes_stays(tmp_path: Path) -> None:
    disk = Disk(tmp_path, 12 * MB, *CONTINUOUS[1:])
    writing = RecordingWriter(tmp_path / CONTINUOUS[0], Encoder(Vehicle()))
    Storage(tmp_path, 10.5 * MB, disk.free, robot="001").check(0)
    assert disk.names() == [CONTINUOUS[0], CONTINUOUS[2]]
    writing.close()


def test_without_a_robot_nothing_is_removed(tmp_path: Path) -> None:
    disk = Disk(tmp_path, 15 * MB, *CONTINUOUS, *INCIDENTS)
    storage = Storage(tmp_path, 10 * MB, disk.free)
    assert storage.check(0) == []
    assert not storage.has_room


def test_no_room_if_files_cannot_be_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = Disk(tmp_path, 12 * MB, *CONTINUOUS)

    def refuse(_: Path, *, missing_ok: bool) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(Path, "unlink", refuse)
    storage = Storage(tmp_path, 10 * MB, disk.free, robot="001")
    assert storage.check(0) == []
    assert not storage.has_room


def test_files_of_one_second_are_ordered_by_number() -> None:
    old = UNNUMBERED
    same = [f"{old}.mcap", *(f"{old}-{n}.mcap" for n in (1, 2, 10))]
    assert names(removable(stored(*reversed(same)), "001")) == same[:3]
    latches = [f"{old}-latch-a-b.mcap", *(f"{old}-latch-a-b-{n}.mcap" for n in (2, 10))]
    assert names(removable(stored(*reversed(latches)), "001")) == latches[:2]


@pytest.mark.parametrize(
    "name",
    [f"lap-{OLD}.mcap", f"lap-{UNNUMBERED}.mcap", f"{UNNUMBERED}-latch-.mcap",
     f"001-9999{OLD[4:]}.mcap", f"001-9{UNNUMBERED[4:]}.mcap", f"{OLD}.html",
     f"{OLD}.mcap.keep", f"{OLD}-lap.mcap", "001.mcap",
     f"002{OLD[3:]}.mcap", f"{OLD}-latch-.mcap", f"0011{OLD[3:]}.mcap", ""],
)  # fmt: skip
def test_foreign_file_names_are_never_removed(name: str) -> None:
    assert removable(stored(name, f"a{name}", *CONTINUOUS[1:]), "001") == stored(CONTINUOUS[1])


def test_only_as_many_files_as_needed_are_removed() -> None:
    files = stored(*CONTINUOUS, *INCIDENTS)
    assert names(to_remove(files, "001", 1, 1)) == CONTINUOUS[:1]
    assert names(to_remove(files, "001", 1, MB)) == CONTINUOUS[:1]
    assert names(to_remove(files, "001", 1, MB + 1)) == CONTINUOUS[:2]
    assert names(to_remove(files, "001", 4 * MB, 9 * MB)) == [*CONTINUOUS[:2], *INCIDENTS[:2]]
