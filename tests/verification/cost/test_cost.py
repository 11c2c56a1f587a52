"""No hot path costs more than it did, and what is expected is what it costs."""

import pytest

from verification.cost.callgrind import allocations, total
from verification.cost.ledger import FILE, Page, complaints, read, written
from verification.cost.syscalls import per_frame
from verification.cost.uncountable import Uncountable
from verification.cost.ways import WAYS, Way

WAIT = "epoll_wait(4, [{events=EPOLLIN}], 3, 5) = 1\n"
FRAME = "recvmsg(22, {msg_iov=[...]}, 0) = 12\n"
NOTHING = "recvmsg(22, {msg_namelen=16}, 0) = -1 EAGAIN (Resource temporarily unavailable)\n"
WAKING = 'write(15, "\\1\\0\\0\\0\\0\\0\\0\\0", 8) = 8\nfutex(0x7f, FUTEX_WAKE_PRIVATE, 1) = 1\n'


@pytest.mark.parametrize("way", WAYS, ids=[way.kinds[0] for way in WAYS])
def test_each_path_costs_what_it_did(way: Way) -> None:
    tolerance, pages = read(FILE.read_text(encoding="utf-8"))
    what = " and ".join(way.kinds)
    known, here = pages[way.kinds[0]].holds_for, way.holds_for()
    if here != known:
        pytest.skip(f"{what} are known for {known}, this is {here}")
    try:
        counted = way.count()
    except Uncountable as why:
        pytest.skip(f"{what} are not counted: {why}")
    told = [
        complaint
        for kind in way.kinds
        for complaint in complaints(kind, pages[kind].counts, counted[kind], tolerance)
    ]
    assert not told, "\n".join(told)


@pytest.mark.parametrize(("count", "told"), [(97.1, 0), (102.9, 0), (96.9, 1), (103.1, 1)])
def test_a_count_fails_up_and_down(count: float, told: int) -> None:
    assert len(list(complaints("opcodes", {"a": 100}, {"a": count}, 0.03))) == told


def test_a_complaint_says_what_to_do() -> None:
    assert list(complaints("opcodes", {"a": 100}, {"a": 110}, 0.03)) == [
        "a: 110 opcodes, 100 expected (+10.0%): find out what for; if it is worth it, "
        "say `python -m verification.cost --renew`"
    ]


def test_paths_that_came_or_went_are_told() -> None:
    old, new = complaints("opcodes", {"a": 1}, {"b": 1}, 0.03)
    assert "stand only in counts.toml" in old
    assert "stand only counted" in new


def test_the_file_is_read_as_it_was_written() -> None:
    pages = {"opcodes": Page("CPython 3.11.7", {"a": 1653.1, "b": 176103902})}
    assert read(written(0.03, pages)) == (0.03, pages)


def test_turns_with_one_frame_are_counted_without_what_wakes_threads() -> None:
    alone = WAIT + FRAME + WAKING + NOTHING
    other = WAIT + FRAME + "write(9, 1) = 1\n" + NOTHING
    both = WAIT + FRAME + FRAME + NOTHING
    assert per_frame((2 * alone + both + other) * 20) == 3
    with pytest.raises(Uncountable, match="too few"):
        per_frame(both * 30)


def test_calls_of_the_allocator_are_counted_by_its_number() -> None:
    lines = [
        "fn=(1) main", "16 2", "cfn=(7) _PyObject_Malloc", "calls=3 20", "16 40",
        "cfi=(2) other.c", "cob=(3) libc.so", "cfn=(9) malloc", "calls=5 20",
        "fn=(8) _PyObject_Calloc", "12 1", "fn=(2) more", "cfi=(4)", "cfn=(7)", "calls=2 20",
        "cfn=(8)", "calls=1 20", "totals: 99", "",
    ]  # fmt: skip
    dump = "\n".join(lines)
    assert (total(dump), allocations(dump)) == (99, 6)
