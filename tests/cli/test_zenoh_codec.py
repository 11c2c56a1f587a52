"""Our codec for zenoh-cli: JSON that shows any payload, messages from JSON."""

import json
import math

import msgpack
import pytest

from cli.zenoh_codec import decode, encode
from common import codec
from common.messages import Drive, PoseRequest

KEY = "t2/v1/001/@cmd/drive/web"


def test_a_delete_shows_as_null() -> None:
    assert decode(KEY, b"") == "null"


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ("zu nah: 近", '"zu nah: 近"'),
        (b"\x47\x53", '"4753"'),
        ({"raw": b"\x01"}, '{"raw": "01"}'),
        ([None, True, 1.5], "[null, true, 1.5]"),
        (math.nan, "NaN"),  # shown as it is, though JSON has no word for it
        (msgpack.ExtType(3, b"x"), '[3, "78"]'),
        (msgpack.Timestamp(1, 2), '"Timestamp(seconds=1, nanoseconds=2)"'),
    ],
)
def test_it_shows_what_is_there(value: object, shown: str) -> None:
    assert decode(KEY, msgpack.packb(value)) == shown


@pytest.mark.parametrize(
    "payload",
    [b"\xc1", b"\x92\x01", b"\x01\x02", b"\xa1\xff", b"\x81\xc4\x01a\x01", b"\x91" * 9999],
)
def test_what_is_no_message_is_shown_in_hex(payload: bytes) -> None:
    assert json.loads(decode(KEY, payload)) == {"not_msgpack": payload.hex()}


def test_what_is_typed_becomes_a_message_with_header() -> None:
    first, second = (
        codec.decode(encode(KEY, '{"linear": 0.1, "angular": 0, "echo": 3}'), Drive)
        for _ in range(2)
    )
    assert (first.linear, first.angular, first.echo) == (0.1, 0.0, 3)
    assert second.seq == first.seq + 1
    assert first.boot == second.boot != 0
    assert 0 < first.t_ns <= second.t_ns
    assert 0 < first.mono_ns <= second.mono_ns


def test_a_typed_header_stands() -> None:
    text = '{"linear": 0, "angular": 0, "echo": 0, "seq": 99, "boot": 5}'
    message = codec.decode(encode(KEY, text), Drive)
    assert (message.seq, message.boot) == (99, 5)


def test_a_request_has_no_header() -> None:
    payload = encode("t2/v1/001/srv/odom/reset", '{"x": 1}')
    assert codec.decode(payload, PoseRequest) == PoseRequest(x=1.0)


@pytest.mark.parametrize("text", ["", "0.1", "[1]", '"x"', "null", "{", "{'a': 1}"])
def test_what_is_no_object_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"Expecting|a message is a JSON object"):
        encode(KEY, text)
