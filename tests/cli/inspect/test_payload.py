"""Any payload is decoded without an exception, and shown as text."""

import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from cli.inspect import output
from cli.inspect.payload import Reading, at, read
from t2 import codec
from t2.errors import MessageError
from t2.messages import Bumper

TYPED = codec.encoding(Bumper)


@pytest.mark.parametrize(
    ("payload", "encoding", "expected"),
    [
        (b"", TYPED, Reading("empty", None)),
        (b'{"a": 1}', "application/json", Reading("json", {"a": 1})),
        (b"{", "application/json", Reading("bytes", b"{", "not JSON")),
        (b"caf\xe9", "text/plain", Reading("text", "caf\ufffd")),
        (b"\x81\xa1a\x01", "zenoh/bytes", Reading("msgpack", {"a": 1})),
        (b"\x01", "image/jpeg", Reading("image/jpeg", b"\x01")),
        (b"go", "zenoh/string", Reading("text", "go")),
        (b"\xc1", TYPED, Reading("bytes", b"\xc1", "not MessagePack")),
        (
            b"\x81\xa1a\x01",
            "application/msgpack;t2.v1.Warp",
            Reading("Warp", {"a": 1}, "unknown type Warp"),
        ),
    ],
)
def test_foreign_payloads(payload: bytes, encoding: str, expected: Reading) -> None:
    assert read(payload, encoding) == expected


@given(
    st.binary() | st.integers(0, 400).map(lambda depth: b"\x91" * depth),
    st.sampled_from(
        [TYPED, "application/msgpack;t2.v1.Odometry", "application/json", "text/x", "a/b", ""]
    ),
)
@example(b"\x81\x91\x01\x01", "")  # a list for a key
@example(b"\xd6\xff\x00\x00\x00\x00", "")  # a time stamp
@example(b"\xcb\x7f\xf8\x00\x00\x00\x00\x00\x00", "")  # NaN
@example(b"\xa1\xff", "")  # text that is no UTF-8
@example(b"\x91" * 100_000 + b"\x01", "")
def test_every_payload_is_decoded(payload: bytes, encoding: str) -> None:
    reading = read(payload, encoding)
    msgspec.json.encode(output.plain(reading.value))
    assert isinstance(output.fields(reading.value), str)


def test_a_field_by_its_path() -> None:
    value = {"causes": [{"name": "contact"}], "x": 1, "none": None}
    assert at(value, "causes.0.name") == "contact"
    # They change from message to message: that is no mistake of the command.
    assert at(value, "causes.1.name") is at(value, "none.name") is None
    for path in ("z", "causes.x", "causes.-1", "causes.²", "causes.0.z", "x.y"):
        with pytest.raises(MessageError, match="has no field"):
            at(value, path)


# --- as text --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ({"a": [1.0, 1.23456789], "b": [], "d": {}}, "a: [1, 1.23457]\nb: []\nd: {}"),
        ({"a": [{"b": {"c": 1}}]}, "a:\n  -\n    b:\n      c: 1"),
        ("words\x07\nx: 1", "words\\u0007\\nx: 1"),
        ("", '""'),
        (bytes(70), f"{'00' * 64}... (70 bytes)"),
    ],
)
def test_fields(value: object, shown: str) -> None:
    assert output.fields(value) == shown
