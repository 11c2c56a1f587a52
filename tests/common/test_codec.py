"""Messages to bytes and back, and what is refused on the way in."""

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from t2.codec import decode, encode
from t2.errors import MessageError
from t2.messages import (
    Bumper,
    Cause,
    Command,
    Limits,
    Motion,
    PoseRequest,
    SafetyState,
)

STATE = SafetyState(
    seq=3,
    boot=2**63 - 1,
    verdict="slow",
    latched=("contact",),
    causes=(Cause(name="obstacle", action="slow", age=0.5, text="etwas ist nah: 近"),),
    source=None,
    limits=Limits(forward=0.1, backward=1.0, angular=0.5),
    heartbeat=7,
    text="slow",
)


@given(st.builds(Motion, command=st.sampled_from(Command),
                 linear=st.floats(-1e9, 1e9), angular=st.floats(-1e9, 1e9),
                 source=st.none() | st.text(), seq=st.integers(0, 2**63)))  # fmt: skip
def test_every_motion_comes_back(motion: Motion) -> None:
    assert decode(encode(motion), Motion) == motion


@pytest.mark.parametrize(
    ("about", "field"),
    [
        ({"pressed": 1}, r"Expected `bool`, got `int` - at `\$.pressed`"),
        ({}, "missing required field `pressed`"),
        ({"pressed": True, "seq": "1"}, r"Expected `int`, got `str` - at `\$.seq`"),
        (None, "Expected `object`, got `None`"),
    ],
)
def test_a_wrong_type_is_refused_by_its_field(about: object, field: str) -> None:
    with pytest.raises(MessageError, match=f"^not a Bumper: .*{field}"):
        decode(msgpack.packb(about), Bumper)


def test_a_request_refuses_what_it_does_not_know() -> None:
    with pytest.raises(MessageError, match="unknown field `hold`"):
        decode(msgpack.packb({"hold": True}), PoseRequest)


HOSTILE = {
    "nothing": b"",
    "no msgpack": b"\xc1",
    "cut off": encode(STATE)[:-1],
    "more behind it": encode(STATE) + b"\x00",
    "a list said to be endless": b"\x81\xa7latched\xdd\xff\xff\xff\xff",
    "a map said to be endless": b"\xdf\xff\xff\xff\xff",
    "a text said to be endless": b"\x81\xa4text\xdb\xff\xff\xff\xff",
    "deeper than any stack": b"\x81\xa1x" + b"\x91" * 100_000,
    "no UTF-8": b"\x81\xa4text\xa1\xff",
    "an extension": msgpack.packb(msgpack.ExtType(5, b"x")),
    "a megabyte": msgpack.packb(b"\x00" * 1_000_000),
}


@pytest.mark.parametrize("payload", HOSTILE.values(), ids=HOSTILE)
def test_hostile_bytes_are_refused(payload: bytes) -> None:
    with pytest.raises(MessageError):
        decode(payload, SafetyState)
