"""Our codec for zenoh-cli: JSON that shows any payload, messages from JSON."""

import json
import math

import msgpack
import pytest

from t2 import codec
from t2.messages import Drive, PoseRequest
from t2.zenoh_codec import decode, encode

KEY = "t2/v1/001/@cmd/drive/web"


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ("zu nah: 近", '"zu nah: 近"'),
        ({"raw": b"\x01"}, '{"raw": "01"}'),
        (math.nan, "NaN"),  # shown as it is, though JSON has no word for it
        (msgpack.Timestamp(1, 0), '"1970-01-01 00:00:01+00:00"'),
        (msgpack.ExtType(5, b"x"), '"Ext(5, 78)"'),
    ],
)
def test_payloads_as_json(value: object, shown: str) -> None:
    assert decode(KEY, msgpack.packb(value)) == shown


@pytest.mark.parametrize("payload", [b"\xc1", b"\x01\x02", b"\xa1\xff", b"\x91" * 9999])
def test_what_is_no_message_is_shown_in_hex(payload: bytes) -> None:
    assert json.loads(decode(KEY, payload)) == {"not_msgpack": payload.hex()}
    assert decode(KEY, b"") == "null"


def test_a_typed_message_gets_a_header() -> None:
    text = '{"linear": 0.1, "angular": 0, "echo": 3}'
    first, second = (codec.decode(encode(KEY, text), Drive) for _ in range(2))
    assert (first.linear, first.angular, first.echo) == (0.1, 0.0, 3)
    assert second.seq == first.seq + 1
    assert first.boot == second.boot != 0
    assert 0 < first.t_ns <= second.t_ns
    assert 0 < first.mono_ns <= second.mono_ns
    typed = codec.decode(encode(KEY, text[:-1] + ', "seq": 99, "boot": 5}'), Drive)
    assert (typed.seq, typed.boot) == (99, 5)


def test_a_request_has_no_header() -> None:
    payload = encode("t2/v1/001/srv/odom/reset", '{"x": 1}')
    assert codec.decode(payload, PoseRequest) == PoseRequest(x=1.0)


@pytest.mark.parametrize("text", ["", "[1]", "null", "{'a': 1}"])
def test_what_is_no_object_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"Expecting|a message is a JSON object"):
        encode(KEY, text)
