"""Any payload is shown as what it is, and never with a stack trace."""

import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from cli.inspect import output
from cli.inspect.payload import Reading, at, kinds, read
from common import codec
from common.errors import MessageError
from common.messages import Bumper, Velocity

TYPED = codec.encoding(Bumper)


def test_a_message_by_its_encoding() -> None:
    reading = read(codec.encode(Bumper(pressed=True)), TYPED)
    assert (reading.kind, reading.value["pressed"], reading.complaint) == ("Bumper", True, "")


@pytest.mark.parametrize(
    ("payload", "encoding", "expected"),
    [
        (b"", TYPED, Reading("empty", None)),
        (b'{"a": 1}', "application/json", Reading("json", {"a": 1})),
        (b"{", "application/json", Reading("bytes", b"{", "no JSON")),
        (b"caf\xe9", "text/plain", Reading("text", "caf\ufffd")),
        (b"\x81\xa1a\x01", "zenoh/bytes", Reading("msgpack", {"a": 1})),
        (b"\xc1", "zenoh/bytes", Reading("bytes", b"\xc1", "no MessagePack")),
        (b"\xc1", TYPED, Reading("bytes", b"\xc1", "no MessagePack")),
        (
            b"\x81\xa1a\x01",
            "application/msgpack;t2.v1.Warp",
            Reading("Warp", {"a": 1}, "Warp is unknown here"),
        ),
    ],
)
def test_what_is_no_message_of_ours(payload: bytes, encoding: str, expected: Reading) -> None:
    assert read(payload, encoding) == expected


def test_a_wrong_message_is_shown_with_its_fault() -> None:
    reading = read(codec.encode(Velocity(linear=1.0, angular=0.0)), TYPED)
    assert reading.value["linear"] == 1.0
    assert "pressed" in reading.complaint


@given(
    st.binary() | st.integers(0, 400).map(lambda depth: b"\x91" * depth),
    st.sampled_from(
        [TYPED, "application/msgpack;t2.v1.Odometry", "application/json", "text/x", ""]
    ),
)
@example(b"\x81\x91\x01\x01", "")  # a list for a key
@example(b"\x81\x81\x01\x01\x01", "")  # a map for a key
@example(b"\xd6\xff\x00\x00\x00\x00", "")  # a time stamp
@example(b"\xd4\x05\x00", "")  # an extension
@example(b"\xcb\x7f\xf8\x00\x00\x00\x00\x00\x00", "")  # NaN
@example(b"\xa1\xff", "")  # text that is no UTF-8
@example(b"\x91" * 100_000 + b"\x01", "")
def test_nothing_is_too_strange_to_be_shown(payload: bytes, encoding: str) -> None:
    reading = read(payload, encoding)
    msgspec.json.encode(output.plain(reading.value))
    assert isinstance(output.fields(reading.value), str)


def test_a_field_by_its_path() -> None:
    value = {"causes": [{"name": "contact"}], "x": 1}
    assert at(value, "x") == 1
    assert at(value, "causes.0.name") == "contact"


@pytest.mark.parametrize(
    ("value", "path", "said"),
    [
        ({"x": 1, "y": 2}, "z", "no 'z' of 'z'; there is: x, y"),
        ({"causes": [1, 2]}, "causes.2", "there is: 0 to 1"),
        ({"causes": []}, "causes.0", "nothing in it"),
        ({}, "x", "nothing in it"),
        (None, "x", "a single value"),
    ],
)
def test_a_field_that_is_not_there_names_those_that_are(
    value: object, path: str, said: str
) -> None:
    with pytest.raises(MessageError, match=said):
        at(value, path)


def test_every_kind_is_known_by_its_name() -> None:
    assert kinds()["Odometry"].__name__ == "Odometry"
    assert {"Done", "Cause", "SwitchesRequest"} <= kinds().keys()
