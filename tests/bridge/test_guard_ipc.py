"""The pipe between guard and bridge: inherited descriptors and the heartbeat."""

import os
from collections.abc import Iterator

import pytest

from services.bridge.guard_ipc import Heartbeat, Inherited, received


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    out, into = os.pipe()
    yield out, into
    for descriptor in (out, into):
        try:
            os.close(descriptor)
        except OSError:
            continue


@pytest.mark.parametrize("inherited", [Inherited((3, 4), 5), Inherited((7,), 6)])
def test_the_child_gets_what_the_parent_leaves_open(inherited: Inherited) -> None:
    assert received(inherited.environ()) == inherited
    assert inherited.descriptors == (*inherited.sockets, inherited.heartbeat)


def test_a_beat_names_the_port_in_use(pipe: tuple[int, int]) -> None:
    heartbeat = Heartbeat(pipe[1], pytest.fail)
    for port in (0, 1, 0):
        heartbeat.beat(port)
    assert os.read(pipe[0], 10) == b"\0\1\0"


def test_a_guard_that_does_not_read_holds_nobody_up(pipe: tuple[int, int]) -> None:
    heartbeat = Heartbeat(pipe[1], pytest.fail)
    for _ in range(100_000):
        heartbeat.beat(0)


def test_the_end_is_told_once(pipe: tuple[int, int]) -> None:
    heartbeat = Heartbeat(pipe[1], pytest.fail)
    heartbeat.end()
    heartbeat.end()
    heartbeat.beat(0)
    assert os.read(pipe[0], 10) == b""


def test_a_dead_guard_is_noticed_once(pipe: tuple[int, int]) -> None:
    gone: list[None] = []
    heartbeat = Heartbeat(pipe[1], lambda: gone.append(None))
    heartbeat.beat(0)
    assert gone == []
    os.close(pipe[0])
    for _ in range(3):
        heartbeat.beat(0)
    assert gone == [None]
