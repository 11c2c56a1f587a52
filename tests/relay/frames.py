"""Frames between PC and board, for the tests of the relay."""

from services.relay import wire

RUN, ZERO = (wire.frame(wire.MOTION, bytes([1, speed, 0, 0, 0])) for speed in (100, 0))
STOP = wire.frame(wire.MOTION, bytes(5))
QUERY = wire.frame(wire.BUMPER, b"")
HIT, CLEAR = wire.frame(wire.BUMPER, b"\1"), wire.frame(wire.BUMPER, b"\0")
