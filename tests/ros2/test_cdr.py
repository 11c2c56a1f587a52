"""Payloads against rosbags, attachments as captured, and hostile bytes."""

import contextlib
import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.ros2 import cdr
from services.ros2.cdr import CdrError
from services.ros2.definitions import HASHES
from tests.ros2 import oracle

TYPES = sorted(name for name in oracle.message_types() if name in HASHES or "/srv/" in name)
READ = "geometry_msgs/msg/TwistStamped", "std_srvs/srv/Trigger_Response", "tf2_msgs/msg/TFMessage"


ATTACHED = bytes.fromhex("0100000000000000c41d526ef347ea18106ddcb54a141ce8bf846ab67b5087d2b9")


@pytest.mark.parametrize("name", TYPES)
@given(data=st.data())
def test_a_payload_is_that_of_rosbags(name: str, data: st.DataObject) -> None:
    value = data.draw(oracle.values(name))
    message = oracle.as_rosbags(name, value)
    expected = bytes(oracle.STORE.serialize_cdr(message, oracle.as_message(name)))
    made = cdr.encode(name, value)
    assert made == expected[: len(made)]
    assert not any(expected[len(made) :])  # padding at the end
    assert cdr.decode(name, expected) == value


@pytest.mark.parametrize("name", READ)
@given(raw=st.binary(max_size=200))
def test_any_bytes_are_a_message_or_an_error(name: str, raw: bytes) -> None:
    for payload in (raw, cdr.HEADER + raw):
        with contextlib.suppress(CdrError):
            cdr.decode(name, payload)


@pytest.mark.parametrize("name", READ)
@given(data=st.data())
def test_every_truncated_payload_is_an_error(name: str, data: st.DataObject) -> None:
    payload = cdr.encode(name, data.draw(oracle.values(name)))
    with pytest.raises(CdrError):
        cdr.decode(name, payload[: data.draw(st.integers(0, len(payload) - 1))])


def test_an_empty_request_has_one_byte_or_none() -> None:
    for payload in (cdr.HEADER, cdr.HEADER + b"\0"):
        assert cdr.decode("std_srvs/srv/Trigger_Request", payload) == ()
    assert cdr.encode("std_srvs/srv/Trigger_Request", ()) == cdr.HEADER


def test_a_captured_twist_is_read() -> None:
    """A TwistStamped with an empty frame: its padding is not zero, as in ROS."""
    header = struct.pack("<iII", 0, 0, 1) + b"\0" + b"\xaa\xbb\xcc"
    payload = cdr.HEADER + header + struct.pack("<6d", 0.25, 0, 0, 0, 0, -0.5)
    decoded = cdr.decode("geometry_msgs/msg/TwistStamped", payload)
    assert decoded == (((0, 0), ""), ((0.25, 0.0, 0.0), (0.0, 0.0, -0.5)))


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"\x01\x01\x00\x00\x00", "String: not plain little-endian CDR: 01 01 00 00$"),
        (b"", "not plain little-endian CDR"),
        (b"\x00\x00\x00\x00", "not plain little-endian CDR"),  # big-endian
        (b"\x00\x01", "2 bytes are no message"),
        (cdr.HEADER + struct.pack("<I", 2**31), "a string of 2147483648 bytes does not end"),
        (cdr.HEADER + struct.pack("<I", 2) + b"ab", "does not end"),
        (cdr.HEADER + struct.pack("<I", 3) + b"\xff\xfe\0", "decode"),
    ],
)
def test_an_error_states_what_is_wrong(payload: bytes, reason: str) -> None:
    with pytest.raises(CdrError, match=reason):
        cdr.decode("std_msgs/msg/String", payload)


@pytest.mark.parametrize("items", [10_001, 2**32 - 1])
def test_a_sequence_without_end_is_refused(items: int) -> None:
    with pytest.raises(CdrError, match=f"a sequence of {items} items"):
        cdr.decode("tf2_msgs/msg/TFMessage", cdr.HEADER + struct.pack("<I", items))
    longest = tuple(number % 256 for number in range(cdr.MAX_ITEMS))
    assert cdr.decode("uint8[]", cdr.encode("uint8[]", longest)) == longest


def test_a_covariance_has_no_length_before_it() -> None:
    numbers = tuple(float(number) for number in range(43))
    value = ((numbers[:3], numbers[3:7]), numbers[7:])
    payload = cdr.HEADER + struct.pack("<43d", *numbers)
    assert cdr.encode("geometry_msgs/msg/PoseWithCovariance", value) == payload


def test_a_covariance_of_another_size_is_refused() -> None:
    pose = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    with pytest.raises(CdrError, match="3 values instead of 36"):
        cdr.encode("geometry_msgs/msg/PoseWithCovariance", (pose, (0.0,) * 3))


def test_a_value_without_a_field_is_refused() -> None:
    with pytest.raises(ValueError, match="shorter"):
        cdr.encode("geometry_msgs/msg/Vector3", (0.0, 0.0))


def test_not_a_number_is_kept() -> None:
    stamped = ((0, 0), "f")
    payload = cdr.encode("sensor_msgs/msg/Range", (stamped, 0, 0.5, 0.05, 5.0, math.nan, 0.0))
    assert math.isnan(cdr.decode("sensor_msgs/msg/Range", payload)[5])


def test_the_captured_attachment() -> None:
    about = cdr.attachment(ATTACHED)
    assert (about.sequence, about.source_ns) == (1, 0x18EA47F36E521DC4)
    assert about.gid.hex() == "6ddcb54a141ce8bf846ab67b5087d2b9"
    assert about.encode() == ATTACHED


@pytest.mark.parametrize(
    ("raw", "reason"),
    [
        (b"", "an attachment has 33 bytes, not 0$"),
        (ATTACHED + b"\0", "an attachment has 33 bytes, not 34$"),
        (ATTACHED[:16] + b"\x11" + ATTACHED[17:], "a GID has 16 bytes, not 17$"),
    ],
)
def test_other_bytes_are_no_attachment(raw: bytes, reason: str) -> None:
    with pytest.raises(CdrError, match=f"^{reason}"):
        cdr.attachment(raw)
