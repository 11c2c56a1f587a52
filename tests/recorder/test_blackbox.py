"""Ring buffer, latch detection and dumps of the black box."""

import pytest

from common.freshness import NS_PER_S
from services.recorder.blackbox import (
    CAMERAS_MAX,
    OVERHEAD,
    SIZE_MAX,
    SLICE,
    BlackBox,
    PictureThinning,
    RingBuffer,
)
from services.recorder.reader import Reader
from tests.recorder import samples
from tests.recorder.files_fixture import SPAN_NS, TAIL_NS, Files, at, ns
from tests.recorder.samples import bare


def box_of(files: Files, size_max: int = SIZE_MAX) -> BlackBox:
    return BlackBox(files.open, files.close, SPAN_NS, TAIL_NS, size_max)


def kept(buffer: RingBuffer) -> list[bytes]:
    return [each.payload for _, each in buffer.since(0)]


def test_old_samples_are_dropped() -> None:
    buffer = RingBuffer(2 * NS_PER_S, 1_000_000)
    for second in range(5):
        buffer.add(bare("tel/x" if second else "tel/y", b"%d" % second, at_s=second))
    assert kept(buffer) == [b"2", b"3", b"4"]
    assert buffer.size == 3 * (1 + OVERHEAD)


@pytest.mark.parametrize("count", [1, 100])
def test_a_flood_on_one_key_removes_no_sample_of_the_others(files: Files, count: int) -> None:
    """It also stays within the size limit while a dump waits to be written."""
    limit = 1_000_000
    buffer = RingBuffer(100 * NS_PER_S, limit)
    flood = [bare("tel/flood", bytes(limit // count), at_s=15) for _ in range(5 * count)]
    box = box_of(files, limit)
    before, after = [at(second) for second in range(10, 16)], at(16)
    for each in (*before, *flood, after):
        buffer.add(each)
        box.add(each)
        box.trigger(["contact"], ns(15))
    assert buffer.size <= limit
    own = [each for _, each in buffer.since(0) if each.key != flood[0].key]
    assert own == [*before, after]
    box.close()
    ((*times,),) = files.read()
    assert files.closed[0].stat().st_size < 2 * limit
    assert [each for each in times if each != 15.0] == [10.0, 11.0, 12.0, 13.0, 14.0, 16.0]


def test_a_slow_disk_loses_no_sample_of_a_dump(files: Files) -> None:
    box = box_of(files)
    box.add(at(0))
    box.trigger(["contact"], ns(0))
    for second in range(1, 30):  # the buffer holds 10 s
        box.add(at(second))
    box.write(ns(30))
    assert files.read() == [[0.0, 1.0, 2.0]]
    assert len(list(box._buffer.since(0))) == 30
    box.add(at(30))
    assert len(list(box._buffer.since(0))) == 11


@pytest.mark.parametrize(
    ("states", "found"),
    [
        (([], ["b"], ["b"], ["a", "b"], [], ["b"]), [[], ["b"], [], ["a"], [], ["b"]]),
        ((["a"], ["a", "b"]), [[], ["b"]]),  # those of the first state latched before
    ],
)
def test_only_new_latches_are_reported(
    files: Files, states: list[list[str]], found: list[list[str]]
) -> None:
    box = box_of(files)
    assert [box.new_causes(samples.state(*names)) for names in states] == found


def test_further_latches_extend_a_dump_up_to_a_limit(files: Files) -> None:
    box = box_of(files)
    for second in range(30):
        box.add(at(second))
        if second >= 5:
            box.trigger(["contact"], ns(second))
            if files.closed:
                break
        box.write(ns(second))
        box.flush()
    assert files.read() == [[float(second) for second in range(16)]]


def test_a_dump_is_written_in_slices(files: Files) -> None:
    box = box_of(files)
    for _ in range(3 * SLICE):
        box.add(at(0))
    box.trigger(["contact"], ns(0))
    for _ in range(3):
        assert files.closed == []
        box.write(ns(5))
    assert [len(each) for each in files.read()] == [3 * SLICE]


def test_close_writes_all_pending_samples_and_finish_none(files: Files) -> None:
    box = box_of(files)
    for end in (box.close, box.finish):
        end()  # without a dump
        for _ in range(SLICE + 5):
            box.add(at(0))
        box.trigger(["estop", "contact"], ns(0))
        box.write(ns(0))
        end()
    assert [len(each) for each in files.read()] == [SLICE + 5, SLICE]
    assert files.closed[0].name.endswith("-latch-estop-contact.mcap")
    box.write(ns(9))
    assert len(files.closed) == 2


PICTURES = "tel/camera/front/picture"


def test_two_pictures_a_second_are_recorded() -> None:
    thinning = PictureThinning()
    for path, expected in (("tel/camera/front/picture", 2), ("tel/camera/front/state", 15)):
        kept = [n for n in range(15) if thinning.keeps(bare(path, b"", at_s=n / 15))]
        assert len(kept) == expected
    assert thinning.keeps(bare("tel/camera/rear/picture", b"", at_s=0.1))  # another camera
    others = [bare(f"tel/camera/c{n}/picture", b"", at_s=1.0) for n in range(2 * CAMERAS_MAX)]
    assert sum(map(thinning.keeps, others)) == CAMERAS_MAX - 2


def test_a_dump_has_the_pictures_of_the_last_half_minute(files: Files) -> None:
    box = BlackBox(files.open, files.close, 120 * NS_PER_S, TAIL_NS, SIZE_MAX)
    for second in range(100):
        box.add(bare(PICTURES, b"%d" % second, at_s=second))
        box.add(at(second))
    box.trigger(["contact"], ns(100))
    box.close()
    with Reader(files.closed[0]) as reader:
        found = [each.sample for each in reader]
    pictures = [one.payload for one in found if one.key.endswith("/picture")]
    assert pictures == [b"%d" % second for second in range(70, 100)]
    assert len(found) - len(pictures) == 100
