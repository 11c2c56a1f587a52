"""The last minutes, and what latched."""

from common.freshness import NS_PER_S
from services.recorder.latches import Latches
from services.recorder.ring_buffer import OVERHEAD, Memory
from tests.recorder import samples
from tests.recorder.samples import bare


def kept(memory: Memory) -> list[bytes]:
    return [each.payload for each in memory.samples()]


def test_what_is_too_old_goes() -> None:
    memory = Memory(2 * NS_PER_S, 1_000_000)
    for second in range(5):
        memory.add(bare("tel/x", b"%d" % second, at_s=second))
    assert kept(memory) == [b"2", b"3", b"4"]
    assert memory.size == 3 * (1 + OVERHEAD)


def test_what_is_too_much_goes() -> None:
    memory = Memory(100 * NS_PER_S, 3 * (OVERHEAD + 10))
    for number in range(9):
        memory.add(bare("tel/x", b"12345", raw=b"%05d" % number))
    assert [each.raw for each in memory.samples()] == [b"00006", b"00007", b"00008"]


def test_what_alone_is_too_much_is_not_kept() -> None:
    memory = Memory(100 * NS_PER_S, OVERHEAD + 10)
    memory.add(bare("tel/x", bytes(11)))
    assert (kept(memory), memory.size) == ([], 0)
    memory.add(bare("tel/x", bytes(10)))
    assert kept(memory) == [bytes(10)]


def test_what_is_given_out_does_not_change() -> None:
    memory = Memory(100 * NS_PER_S, 1_000_000)
    memory.add(bare("tel/x", b"1"))
    given = memory.samples()
    memory.add(bare("tel/x", b"2"))
    assert len(given) == 1


def test_only_new_latches_count() -> None:
    latches = Latches()
    states: tuple[list[str], ...] = (
        [],
        ["contact"],
        ["contact"],
        ["estop", "contact"],
        [],
        ["contact"],
    )
    found = [latches.take(samples.state(*names)) for names in states]
    assert found == [[], ["contact"], [], ["estop"], [], ["contact"]]


def test_what_was_latched_before_the_first_word_is_an_old_story() -> None:
    latches = Latches()
    assert latches.take(samples.state("estop")) == []
    assert latches.take(samples.state("estop", "contact")) == ["contact"]
