"""Round trip of samples through JSON."""

import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.settings import Vehicle
from services.recorder.mcap_codec import JSON, Channel, Encoder, Entry
from t2 import codec
from t2.codec import Sample
from t2.errors import MessageError
from t2.messages import Velocity
from tests.recorder import samples
from tests.recorder.samples import BEGIN_NS, ROOT, bare, sample

ENCODER = Encoder(Vehicle())
VELOCITY = "tel/bridge/velocity"


def entry(it: Sample) -> Entry:
    """Return the message without its views."""
    return next(ENCODER.entries(it, it.wall_ns))


def test_a_message_is_json_with_its_schema() -> None:
    made = entry(sample(VELOCITY, samples.velocity(seq=2**32 + 7)))
    assert msgspec.json.decode(made.data, type=Velocity) == samples.velocity(seq=2**32 + 7)
    assert set(msgspec.json.decode(made.data)) == set(Velocity.__struct_fields__)
    assert made.channel.schema is not None
    assert made.channel.schema.name == "t2.v1.Velocity"
    assert made.log_ns == BEGIN_NS
    odd = entry(sample(VELOCITY, samples.velocity(math.nan)))
    assert b"_payload" in odd.data
    foreign = entry(bare("tel/mine", msgspec.msgpack.encode({"celsius": 21.5})))
    assert foreign.channel.schema is None
    assert msgspec.json.decode(foreign.data) == {"celsius": 21.5}


@pytest.mark.parametrize(
    "it",
    [
        sample(VELOCITY, samples.velocity()),
        sample(VELOCITY, samples.velocity(), raw=b"\x00\xff"),
        sample(VELOCITY, samples.velocity(), raw=b""),
        sample(VELOCITY, samples.velocity(math.nan)),
        sample(VELOCITY, samples.velocity(math.inf)),
        sample("tel/odom/odometry", samples.odometry()),
        bare("estop", b""),
        bare("estop", b"", deleted=True),
        bare("estop", b"now", "text/plain"),
        bare("tel/mine", b'{"a": 1}', JSON),
        bare("tel/mine", b'{"a":1}', JSON),
        bare("tel/mine", b'{"a"', JSON),
        bare("tel/mine", msgspec.msgpack.encode([1, 2])),
        bare("tel/mine", msgspec.msgpack.encode({1: 2})),
        bare("tel/mine", msgspec.msgpack.encode({"a": b"bytes"})),
        bare("tel/mine", msgspec.msgpack.encode({"_raw": "mine"})),
        bare("tel/mine", msgspec.msgpack.encode({"x": msgspec.msgpack.Ext(5, b"x")})),
        bare("tel/mine", b"\x81\xa1a\xca\x3f\x80\x00\x00"),  # a float of 32 bits
        bare("tel/mine", b"\xdf\x00\x00\x00\x00"),  # an empty map with a long header
        bare("tel/mine", b"\x91" * 3000 + b"\x90"),  # deeper than the recursion limit
        bare(VELOCITY, b"\xc1", codec.encoding(Velocity)),
        bare("app/camera/front", b"\xff\xd8\xff\xe0", "image/jpeg"),
        bare("app/camera/front", b"", "image/jpeg", deleted=True),
        sample("app/planner/pose", samples.odometry(), raw=b"\x01"),
    ],
    ids=repr,
)
def test_round_trip_restores_the_bytes(it: Sample) -> None:
    back = entry(it).sample
    assert (back.key, back.payload, back.encoding) == (it.key, it.payload, it.encoding)
    assert (back.raw, back.deleted) == (it.raw, it.deleted)
    assert back.wall_ns == it.wall_ns


@given(payload=st.binary(max_size=60), raw=st.none() | st.binary(max_size=9), deleted=st.booleans())
def test_round_trip_of_arbitrary_bytes(payload: bytes, raw: bytes | None, deleted: bool) -> None:
    for encoding in ("", JSON, codec.encoding(Velocity)):
        back = entry(bare("tel/mine", payload, encoding, raw=raw, deleted=deleted)).sample
        assert (back.payload, back.raw, back.deleted) == (payload, raw, deleted)


def test_views_follow_the_message() -> None:
    made = ENCODER.entries(sample("tel/odom/odometry", samples.odometry()), 5)
    assert [each.key for each in made] == [f"{ROOT}/tel/odom/odometry", "foxglove/tf"]


@pytest.mark.parametrize("path", ["app/planner/pose", "app/planner"])
def test_keys_of_members_are_no_messages_of_t2(path: str) -> None:
    """Whatever encoding they name: anybody could place the vehicle in a view or a report."""
    made = list(ENCODER.entries(sample(path, samples.odometry()), 5))
    assert [each.key for each in made] == [f"{ROOT}/{path}"]
    assert (made[0].kind, made[0].message, made[0].channel.schema) == ("", None, None)
    own = entry(sample("tel/app/odometry", samples.odometry()))
    assert own.kind == "Odometry"


@pytest.mark.parametrize("data", [b"[]", b"{", b'{"_payload": "?"}', b'{"_raw": 5}'])
def test_foreign_entries_are_rejected(data: bytes) -> None:
    with pytest.raises(MessageError, match="not written by the recorder"):
        _ = Entry(Channel("a/key", None), data, 0).sample
