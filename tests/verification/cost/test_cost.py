"""The costs of the hot paths are as expected."""

import pytest

from verification.cost.ledger import FILE, Section, UncountableError, complaints, read, written
from verification.cost.methods import METHODS, Method, allocations, total
from verification.cost.syscalls import per_frame

WAIT = "epoll_wait(4, [{events=EPOLLIN}], 3, 5) = 1\n"
FRAME = "recvmsg(22, {msg_iov=[...]}, 0) = 12\n"
NOTHING = "recvmsg(22, {msg_namelen=16}, 0) = -1 EAGAIN (Resource temporarily unavailable)\n"
WAKING = 'write(15, "\\1\\0\\0\\0\\0\\0\\0\\0", 8) = 8\nfutex(0x7f, FUTEX_WAKE_PRIVATE, 1) = 1\n'


# Callgrind takes half a minute of a core.
EACH = [
    pytest.param(
        method,
        marks=[pytest.mark.campaign] if "instructions" in method.kinds else [],
        id=method.kinds[0],
    )
    for method in METHODS
]


@pytest.mark.parametrize("method", EACH)
def test_each_path_has_its_expected_cost(method: Method) -> None:
    tolerance, sections = read(FILE.read_text(encoding="utf-8"))
    what = " and ".join(method.kinds)
    known, here = sections[method.kinds[0]].holds_for, method.holds_for()
    if here != known:
        pytest.skip(f"{what} are known for {known}, this is {here}")
    try:
        counted = method.count()
    except UncountableError as reason:
        pytest.skip(f"{what} are not counted: {reason}")
    found = [
        complaint
        for kind in method.kinds
        for complaint in complaints(kind, sections[kind].counts, counted[kind], tolerance)
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(("count", "found"), [(97.1, 0), (102.9, 0), (96.9, 1), (103.1, 1)])
def test_a_count_fails_up_and_down(count: float, found: int) -> None:
    assert len(list(complaints("opcodes", {"a": 100}, {"a": count}, 0.03))) == found


def test_a_complaint_says_what_to_do() -> None:
    assert list(complaints("opcodes", {"a": 100}, {"a": 110}, 0.03)) == [
        "a: 110 opcodes, 100 expected (+10.0%): find the cause; if it is justified, "
        "run `python -m verification.cost --renew`"
    ]


def test_paths_that_came_or_went_are_told() -> None:
    old, new = complaints("opcodes", {"a": 1}, {"b": 1}, 0.03)
    assert "only in counts.toml" in old
    assert "only counted" in new


def test_the_file_is_read_as_it_was_written() -> None:
    sections = {"opcodes": Section("CPython 3.11.7", {"a": 1653.1, "b": 176103902})}
    assert read(written(0.03, sections)) == (0.03, sections)


def test_turns_with_one_frame_are_counted_without_what_wakes_threads() -> None:
    alone = WAIT + FRAME + WAKING + NOTHING
    other = WAIT + FRAME + "write(9, 1) = 1\n" + NOTHING
    both = WAIT + FRAME + FRAME + NOTHING
    assert per_frame((2 * alone + both + other) * 20) == 3
    with pytest.raises(UncountableError, match="strace saw only"):
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
