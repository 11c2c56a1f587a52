"""All codecs carry the same values, and refuse the same; else there is nothing to compare."""

import json
from importlib import import_module
from typing import Any

import msgpack
import pytest

from bench.codec import part
from bench.codec.candidate import Candidate
from bench.codec.frame_ctypes import CTYPES
from bench.codec.frame_struct import BY_HAND as FRAMES_BY_HAND
from bench.codec.frame_struct import framed
from bench.codec.frame_t2 import T2 as FRAMES_T2
from bench.codec.message_msgpack import BY_HAND as MESSAGES_BY_HAND
from bench.codec.message_t2 import T2 as MESSAGES_T2
from bench.codec.values import FRAMES, MESSAGES

OTHERS = "needs what `make bench` installs from requirements-bench.lock"
OURS = {
    "frame": {each.name: each for each in (FRAMES_T2, FRAMES_BY_HAND, CTYPES)},
    "message": {each.name: each for each in (MESSAGES_T2, MESSAGES_BY_HAND)},
}
# What the others stand on, and where they are.
THEIRS = {
    "construct": ("construct", "frame_construct", "CONSTRUCT"),
    "pydantic, JSON": ("pydantic", "message_pydantic", "JSON"),
    "pydantic, msgpack": ("pydantic", "message_pydantic", "MSGPACK"),
    "protobuf": ("google.protobuf", "message_protobuf", "PROTOBUF"),
}
MAPS = ["T2", "msgpack by hand", "pydantic, JSON", "pydantic, msgpack"]


def codec(kind: str, name: str) -> Candidate:
    """Return a codec by its name, where its package is installed."""
    if name in OURS[kind]:
        return OURS[kind][name]
    package, module, attribute = THEIRS[name]
    pytest.importorskip(package, reason=OTHERS)
    found = getattr(import_module(f"bench.codec.{module}"), attribute)
    assert isinstance(found, Candidate)
    return found


@pytest.fixture(params=["T2", "struct", "ctypes", "construct"])
def frames(request: pytest.FixtureRequest) -> Candidate:
    """Return each codec of frames."""
    return codec("frame", request.param)


@pytest.fixture(params=[*MAPS, "protobuf"])
def messages(request: pytest.FixtureRequest) -> Candidate:
    """Return each codec of messages."""
    return codec("message", request.param)


@pytest.fixture(params=MAPS)
def maps(request: pytest.FixtureRequest) -> Candidate:
    """Return each codec whose messages are maps of names."""
    return codec("message", request.param)


# --- frames -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FRAMES)
def test_frames_are_the_same_bytes_and_the_same_values(frames: Candidate, name: str) -> None:
    assert frames.encode[name](FRAMES[name]) == FRAMES_T2.encode[name](FRAMES[name])
    assert frames.there_and_back(name, FRAMES[name]) == FRAMES[name]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("velocity report", (-32767, 0)),
        ("velocity report", (0, 32767)),
        ("run command", (2, 0, -1)),
        ("run command", (0, 0, 0)),
        ("bumper report", (False,)),
        ("ultrasonic report", (0,) * 8),
    ],
)
def test_frames_at_their_edges(frames: Candidate, name: str, value: tuple[Any, ...]) -> None:
    assert frames.encode[name](value) == FRAMES_T2.encode[name](value)
    assert frames.there_and_back(name, value) == value


@pytest.mark.parametrize("name", FRAMES)
def test_a_frame_that_is_spoiled_is_refused(frames: Candidate, name: str) -> None:
    good = FRAMES_T2.encode[name](FRAMES[name])
    assert not frames.refuses(name, good)
    for what, bad in {
        "magic": b"SG" + good[2:],
        "size": good[:2] + bytes([good[2] + 1]) + good[3:],
        "id": good[:4] + b"\xff\xff" + good[6:],
        "crc": good[:6] + bytes([good[6] ^ 1]) + good[7:],
        "payload": good[:-1] + bytes([good[-1] ^ 1]),
        "cut": good[:-1],
        "cut in its header": good[:7],
        "followed by half a frame": good + good[:-1],
    }.items():
        assert frames.refuses(name, bad), what


def test_a_command_of_an_unknown_kind_is_refused(frames: Candidate) -> None:
    assert frames.refuses("run command", framed(0x7426, b"\x03\0\0\0\0"))


def test_every_byte_of_the_bumper_but_zero_is_pressed(frames: Candidate) -> None:
    raw = framed(0x7602, b"\x80")
    assert frames.plain("bumper report", frames.decode["bumper report"](raw)) == (True,)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("velocity report", (32768, 0)),
        ("velocity report", (0, -32768)),
        ("run command", (3, 0, 0)),
        ("run command", (1, 0, 32768)),
        ("ultrasonic report", (1, 2, 3)),
        ("ultrasonic report", (1, 2, 3, 4, 5, 6, 7, 65536)),
        ("ultrasonic report", (1, 2, 3, 4, 5, 6, 7, -1)),
    ],
)
def test_a_value_that_the_wire_cannot_carry_is_not_sent(
    frames: Candidate, name: str, value: tuple[Any, ...]
) -> None:
    with pytest.raises(Exception):  # noqa: B017, PT011 - each library has its own
        frames.encode[name](value)


@pytest.mark.parametrize("name", FRAMES)
def test_a_datagram_may_hold_two(frames: Candidate, name: str) -> None:
    raw = FRAMES_T2.encode[name](FRAMES[name])
    first, second = frames.decode[name](raw + raw)
    assert frames.plain(name, [first]) == frames.plain(name, [second]) == FRAMES[name]


# --- messages ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MESSAGES)
def test_messages_give_their_values_back(messages: Candidate, name: str) -> None:
    assert part.same(messages.there_and_back(name, MESSAGES[name]), MESSAGES[name])


@pytest.mark.parametrize("name", MESSAGES)
def test_by_hand_a_message_is_the_same_bytes(name: str) -> None:
    raw = MESSAGES_T2.encode[name](MESSAGES[name])
    assert msgpack.unpackb(MESSAGES_BY_HAND.encode[name](MESSAGES[name])) == msgpack.unpackb(raw)
    assert part.same(MESSAGES_BY_HAND.decode[name](raw), MESSAGES[name])


SPOILED: list[tuple[str, dict[str, Any]]] = [
    ("Velocity", {"linear": "fast"}),
    ("Velocity", {"linear": True}),
    ("Velocity", {"seq": 1.5}),
    ("Bumper", {"pressed": 1}),
    ("Bumper", {"boot": "x"}),
    ("Ultrasonic", {"ranges": [1.0] * 7}),
    ("Ultrasonic", {"ranges": ["1"] * 8}),
    ("Ultrasonic", {"status": ["ok"] * 9}),
    ("Ultrasonic", {"status": ["near"] * 8}),
    ("Motion", {"command": "fly"}),
    ("Motion", {"linear": None}),
    ("Motion", {"source": 7}),
    ("Motion", {"latched": 0}),
    ("Motion", {"judged": "1"}),
    ("Motion", {"predecessor": 1.5}),
    ("SafetyState", {"verdict": "maybe"}),
    ("SafetyState", {"latched": [1]}),
    ("SafetyState", {"causes": [{"name": "contact"}]}),
    ("SafetyState", {"causes": [{"name": "a", "action": "fly", "age": 1.0, "text": ""}]}),
    ("SafetyState", {"limits": {"forward": 1.0, "backward": 1.0}}),
    ("SafetyState", {"limits": None}),
    ("SafetyState", {"text": None}),
    ("Odometry", {"pose_covariance": [0.0] * 8}),
    ("Odometry", {"twist_covariance": [0.0, 0.0, 0.0, "0"]}),
    ("Odometry", {"residual": "0"}),
    ("Odometry", {"slip": None}),
    ("Odometry", {"frame_id": 1}),
]


def packed(candidate: Candidate, fields: dict[str, Any]) -> bytes:
    """Return fields, right or wrong, in the codec's format."""
    raw: bytes
    raw = json.dumps(fields).encode() if "JSON" in candidate.name else msgpack.packb(fields)
    return raw


@pytest.mark.parametrize(("name", "wrong"), SPOILED)
def test_a_message_with_a_wrong_field_is_refused(
    maps: Candidate, name: str, wrong: dict[str, Any]
) -> None:
    assert not maps.refuses(name, packed(maps, MESSAGES[name]))
    assert maps.refuses(name, packed(maps, MESSAGES[name] | wrong))


@pytest.mark.parametrize("name", MESSAGES)
def test_what_may_be_left_out_is_the_same(maps: Candidate, name: str) -> None:
    for field in MESSAGES[name]:
        fields = {key: value for key, value in MESSAGES[name].items() if key != field}
        needed = MESSAGES_T2.refuses(name, msgpack.packb(fields))
        assert maps.refuses(name, packed(maps, fields)) == needed, field


def test_protobuf_checks_no_more_than_the_page_says() -> None:
    protobuf = codec("message", "protobuf")
    assert protobuf.refuses("Velocity", b"\xff")
    assert protobuf.decode["Velocity"](b"").linear == 0.0
    short = protobuf.encode["Odometry"]({"pose_covariance": [1.0]})
    assert list(protobuf.decode["Odometry"](short).pose_covariance) == [1.0]
    beyond = protobuf.encode["Motion"]({"command": 9})
    assert protobuf.decode["Motion"](beyond).command == 9


def test_what_is_spoiled_is_not_timed() -> None:
    liar = Candidate(
        name="liar",
        encode={"Velocity": lambda fields: b""},
        decode={"Velocity": lambda raw: {}},
        plain=lambda name, value: value,
    )
    with pytest.raises(ValueError, match="liar spoils Velocity"):
        part.rows([liar], {"Velocity": MESSAGES["Velocity"]})
