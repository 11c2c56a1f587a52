"""The short, repeatable part of fuzzing: seeds, what was found before, and damage to both."""

import sys
from collections.abc import Sequence
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common import codec, config
from common.wire.framing import Framing
from verification.fuzz import targets
from verification.fuzz.__main__ import main
from verification.fuzz.mutation import mutated
from verification.fuzz.seeds import CORPUS, EXAMPLES, found, seeds
from verification.fuzz.targets import KINDS, TARGETS

FOUND = [(name, raw) for name in TARGETS for raw in found(name).values()]
FOUND_NAMES = [f"{name}-{file}" for name in TARGETS for file in found(name)]


def _replay(name: str) -> None:
    for raw in seeds(name):
        TARGETS[name](raw)


@pytest.mark.parametrize("name", TARGETS)
def test_every_seed_ends_as_declared(name: str) -> None:
    _replay(name)


@pytest.mark.parametrize(("name", "raw"), FOUND, ids=FOUND_NAMES)
def test_what_was_found_ends_as_declared(name: str, raw: bytes) -> None:
    TARGETS[name](raw)


def test_nothing_lies_in_the_corpus_that_is_not_replayed() -> None:
    assert {folder.name for folder in CORPUS.iterdir()} <= set(TARGETS)


def test_there_is_an_example_of_every_message() -> None:
    assert {type(example) for example in EXAMPLES} == set(KINDS)


@st.composite
def damaged(draw: st.DrawFn, raws: Sequence[bytes]) -> bytes:
    """Cut, splice and overwrite known inputs."""
    raw = bytearray(draw(st.sampled_from(raws)))
    for _ in range(draw(st.integers(1, 3))):
        at, size = draw(st.integers(0, len(raw))), draw(st.integers(0, 8))
        other = draw(st.binary(max_size=8) | st.sampled_from(raws).map(lambda one: one[:64]))
        raw[at : at + size] = other
    return bytes(raw)


@pytest.mark.parametrize("name", TARGETS)
def test_damage_ends_as_declared(name: str) -> None:
    raws = [*seeds(name), *found(name).values()]

    @settings(max_examples=300, derandomize=True, database=None)
    @given(damaged(raws))
    def each(raw: bytes) -> None:
        TARGETS[name](raw)

    each()


def test_messages_that_are_nearly_right_end_as_declared() -> None:
    raws = list(seeds("messages"))
    for seed in range(2000):
        TARGETS["messages"](mutated(raws, Random(seed)))


# --- the targets can fail ---------------------------------------------------------------------


def _crash(*_: object) -> None:
    raise KeyError("a bug")


@pytest.mark.parametrize(
    ("name", "owner", "attribute"),
    [
        ("frames", Framing, "part_at"),
        ("messages", codec, "_decoder"),
        ("toml", config, "_leaves"),
        ("environ", config, "_parse"),
        ("sets", config, "_parse"),
    ],
)
def test_another_exception_is_a_finding(
    name: str, owner: object, attribute: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(owner, attribute, _crash)
    with pytest.raises(KeyError, match="a bug"):
        _replay(name)


def test_a_setting_that_is_no_number_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(targets, "flatten", lambda _: [("odom.hold", (1.0, float("nan")))])
    with pytest.raises(AssertionError, match="non-finite"):
        targets.sets(b"board.port=5000")


def test_a_machine_without_atheris_is_told_why(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "atheris", None)
    monkeypatch.setattr(sys, "argv", ["python -m verification.fuzz"])
    assert main() == 69
    assert "Its wheels are for Linux on x86_64" in capsys.readouterr().err
