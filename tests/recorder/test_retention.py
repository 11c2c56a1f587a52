"""Selection of the recordings to remove when the disk is full."""

import pytest

from services.recorder.retention import removable, to_remove
from services.recorder.storage import MB
from tests.recorder.files_fixture import CONTINUOUS, INCIDENTS, OLD, names, stored


def test_continuous_files_first_and_the_newest_of_each_kind_stays() -> None:
    files = stored(*reversed(CONTINUOUS), *reversed(INCIDENTS))
    assert names(removable(files, "001")) == [*CONTINUOUS[:2], *INCIDENTS[:2]]


def test_marked_files_stay() -> None:
    files = stored(*CONTINUOUS, *INCIDENTS, kept=(CONTINUOUS[0], INCIDENTS[1]))
    assert names(removable(files, "001")) == [CONTINUOUS[1], INCIDENTS[0]]


def test_files_of_one_second_are_ordered_by_number() -> None:
    same = [f"{OLD}.mcap", *(f"{OLD}-{n}.mcap" for n in (1, 2, 10))]
    assert names(removable(stored(*reversed(same)), "001")) == same[:3]
    latches = [f"{OLD}-latch-a-b.mcap", *(f"{OLD}-latch-a-b-{n}.mcap" for n in (2, 10))]
    assert names(removable(stored(*reversed(latches)), "001")) == latches[:2]


@pytest.mark.parametrize(
    "name",
    [f"lap-{OLD}.mcap", f"{OLD}.html", f"{OLD}.mcap.keep", f"{OLD}-lap.mcap", "001.mcap",
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


def test_nothing_is_removed_if_all_files_are_not_enough() -> None:
    files = stored(*CONTINUOUS, *INCIDENTS)
    assert to_remove(files, "001", 4 * MB + 1, 9 * MB) == []
    assert to_remove([], "001", 0, 0) == []
