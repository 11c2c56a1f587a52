"""Which faults are drawn: all of them, the same for the same seed, and none that cannot be done."""

from itertools import islice

import msgspec
import pytest

from sim.requests import Asked, Driver, Wire
from verification.soak.faults import KINDS, PAUSE_S, Fault, Faults

ROUND = len(KINDS)


def drawn(seed: int, count: int, kills: bool = True) -> list[Fault]:
    faults = Faults(seed)
    return list(islice(iter(lambda: faults.next(kills), None), count))


def test_the_same_seed_gives_the_same_and_another_one_does_not() -> None:
    assert drawn(7, 40) == drawn(7, 40)
    assert drawn(7, 40) != drawn(8, 40)


def test_each_round_has_every_kind() -> None:
    names = [fault.name for fault in drawn(3, 3 * ROUND)]
    for begin in range(0, 3 * ROUND, ROUND):
        assert sorted(names[begin : begin + ROUND]) == sorted(KINDS)


def test_without_kills_no_process_is_killed_and_all_the_rest_happens() -> None:
    faults = drawn(3, 60, kills=False)
    assert not any(fault.kills for fault in faults)
    assert {fault.name for fault in faults} == {n for n in KINDS if not n.startswith("kill ")}


@pytest.mark.parametrize("seed", range(20))
def test_every_fault_can_be_done_and_undone(seed: int) -> None:
    for fault in drawn(seed, ROUND):
        assert 0.1 <= fault.seconds <= 4.0
        assert bool(fault.kills) == (fault.begin is None)
        for request in (fault.begin, fault.end):
            if request is not None:
                assert msgspec.json.decode(msgspec.json.encode(request), type=Asked) == request


def test_what_does_not_end_by_itself_is_undone() -> None:
    by_name = {fault.name: fault for fault in drawn(5, ROUND)}
    assert by_name["wire drop"].end == Wire()
    broken, cleared = by_name["driver fault"].begin, by_name["driver fault"].end
    assert isinstance(broken, Driver)
    assert isinstance(cleared, Driver)
    assert broken.bits
    assert (cleared.side, cleared.bits) == (broken.side, 0)
    assert {name for name, fault in by_name.items() if fault.end is None and not fault.kills} == {
        "freeze", "power cycle",
    }  # fmt: skip


def test_what_makes_the_vehicle_stand_is_marked() -> None:
    still = {fault.name for fault in drawn(1, ROUND) if fault.still}
    assert still == {
        "driver fault", "kill router", "kill safety", "kill bridge", "kill driver",
    }  # fmt: skip


def test_pauses_and_choices_stay_within_their_bounds() -> None:
    faults = Faults(1)
    assert all(PAUSE_S[0] <= faults.pause_s() <= PAUSE_S[1] for _ in range(50))
    assert {faults.one_of(2) for _ in range(50)} == {0, 1}
