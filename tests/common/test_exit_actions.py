"""Exit actions of a service run once, whatever signals arrive meanwhile."""

import contextlib
import os
import signal
from collections.abc import Iterator

import pytest

from common.config import Sources, load
from common.service import Node, serve
from common.settings import Shared


@pytest.fixture
def _signals() -> Iterator[None]:
    """Give the handlers back that ``serve`` replaces."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("_signals")
@pytest.mark.parametrize("first", ["a bug", "a signal"])
def test_signals_while_it_leaves_do_not_begin_its_exit_anew(
    first: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended: list[int] = []
    said: list[str] = []
    monkeypatch.setattr(os, "_exit", ended.append)
    sets = ["bus.connect=tcp/127.0.0.1:1"]
    node = Node("teleop", load(Shared, Sources(environ={}, sets=sets)))

    def on_exit() -> None:
        said.append("begun")
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGINT):
            signal.raise_signal(number)
        said.append("over")

    def begin(_: int) -> None:
        if first == "a bug":
            raise ZeroDivisionError
        signal.raise_signal(signal.SIGINT)

    node.on_exit = on_exit
    node.loop.every(1.0, begin)
    with contextlib.suppress(ZeroDivisionError):
        serve(node)
    assert said == ["begun", "over"]
    assert ended == []
