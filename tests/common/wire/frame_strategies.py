"""Hypothesis strategies for every frame of the wire, and their reader."""

from typing import TypeVar

from hypothesis import strategies as st

from common.wire import commands as c
from common.wire import framing
from common.wire import reports as r
from common.wire.frame import Frame, Kinds, Side
from common.wire.framing import Received, Rejected

Part = Received | Rejected
FrameT = TypeVar("FrameT", bound=Frame)

velocities = st.integers(-32767, 32767)
octets = st.integers(0, 255)
sides = st.sampled_from(Side)
ranges_mm = st.tuples(*[st.integers(0, 0xFFFF)] * 8)

commands = st.one_of(
    st.builds(c.MotionCommand, st.sampled_from(c.MotionKind), velocities, velocities),
    st.builds(c.DistanceQuery),
    st.builds(c.UltrasonicQuery),
    st.builds(c.BumperQuery),
    st.builds(c.UltrasonicBrakeSet, st.booleans()),
    st.builds(c.BumperBrakeSet, st.booleans()),
    st.builds(c.DriverQuery, sides),
    st.builds(c.LedSet, octets, octets, st.integers(0, 10), *[octets] * 6),
)

reports = st.one_of(
    st.builds(r.VelocityReport, velocities, velocities),
    st.builds(r.DistanceReport, st.integers(-(2**31), 2**31 - 1), st.integers(-1800, 1800)),
    st.builds(r.UltrasonicReport, ranges_mm),
    st.builds(r.BumperReport, st.booleans()),
    st.builds(r.UltrasonicBrakeReport, st.booleans()),
    st.builds(r.BumperBrakeReport, st.booleans()),
    st.builds(r.DriverReport, sides, st.integers(0, 2**32 - 1)),
    st.builds(r.LedReport, st.booleans()),
)


def read_all(raw: bytes, kinds: Kinds) -> list[Part]:
    """Read a datagram; no byte is lost, and each part has one."""
    parts = framing.read(raw, kinds)
    assert b"".join(part.raw for part in parts) == raw
    assert all(part.raw for part in parts)
    return parts


def made(kind: type[FrameT], payload: bytes) -> FrameT:
    """Return the frame of a payload, or raise ``WireError``."""
    return kind.from_wire(kind.LAYOUT.unpack(payload))
