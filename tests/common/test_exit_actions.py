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


@pytest.mark.usefixtures("_signals")
def test_a_second_signal_says_the_last_words_once_and_a_third_changes_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    said: list[str] = []
    sets = ["bus.connect=tcp/127.0.0.1:1"]
    node = Node("teleop", load(Shared, Sources(environ={}, sets=sets)))

    class Ended(BaseException):
        pass

    def end(code: int) -> None:
        raise Ended(code)

    def on_exit() -> None:
        said.append("begun")
        signal.raise_signal(signal.SIGINT)
        said.append("over")

    def begin(_: int) -> None:
        for _ in range(2):
            signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr(os, "_exit", end)
    node.on_exit = on_exit
    node.loop.every(1.0, begin)
    with pytest.raises(Ended) as ended:
        serve(node)
    assert ended.value.args == (128 + signal.SIGTERM,)
    assert said == ["begun", "over"]
