"""The short, repeatable part of fuzzing: seeds, earlier findings, and mutations of both."""

from collections.abc import Sequence
from pathlib import Path

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import Struct, inspect

from t2 import codec
from verification.fuzz.seeds import CORPUS, example, seeds
from verification.fuzz.targets import KINDS, TARGETS

FOUND = sorted(CORPUS.glob("*/*"))


@pytest.mark.parametrize("file", FOUND, ids=lambda file: f"{file.parent.name}-{file.name}")
def test_an_earlier_finding_ends_as_declared(file: Path) -> None:
    TARGETS[file.parent.name](file.read_bytes())


@st.composite
def damaged(draw: st.DrawFn, raws: Sequence[bytes]) -> bytes:
    """Cut, splice and overwrite known inputs."""
    raw = bytearray(draw(st.sampled_from(raws)))
    for _ in range(draw(st.integers(0, 3))):
        at, size = draw(st.integers(0, len(raw))), draw(st.integers(0, 8))
        other = draw(st.binary(max_size=8) | st.sampled_from(raws).map(lambda one: one[:64]))
        raw[at : at + size] = other
    return bytes(raw)


@pytest.mark.parametrize("name", TARGETS)
def test_seeds_and_damaged_inputs_end_as_declared(name: str) -> None:
    for raw in seeds(name):
        TARGETS[name](raw)
    raws = [b"", *seeds(name), *(file.read_bytes() for file in FOUND if file.parent.name == name)]

    @settings(max_examples=300, derandomize=True, database=None)
    @given(damaged(raws))
    def each(raw: bytes) -> None:
        TARGETS[name](raw)

    each()


@pytest.mark.parametrize("kind", KINDS)
def test_each_message_has_a_valid_seed(kind: type[Struct]) -> None:
    codec.decode(msgpack.packb(example(inspect.type_info(kind))), kind)
