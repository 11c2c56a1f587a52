"""``python -m bench.reaction.loop PORT``: one process with a loop over a socket.

It knows frames and CRC, answers a bumper hit with BRAKE and everything else with STOP.
"""

import math
import socket
import struct
import sys

import crcmod.predefined

CRC = crcmod.predefined.mkCrcFun("crc-16")
HEADER = struct.Struct("<2sHHH")
BUMPER, MOTION = 0x7602, 0x7426
STOP, RUN, BREAK = 0, 1, 2


def command(kind: int, linear_mmps: int = 0) -> bytes:
    """Return a motion frame, forward or standing."""
    payload = struct.pack("<BHH", kind, linear_mmps, 0)
    return HEADER.pack(b"GS", HEADER.size + len(payload), MOTION, CRC(payload)) + payload


def payload_of(datagram: bytes, command_id: int) -> bytes | None:
    """Return the payload of a valid frame with this id, else None."""
    if len(datagram) < HEADER.size:
        return None
    magic, size, named, crc = HEADER.unpack_from(datagram)
    payload = datagram[HEADER.size : size]
    valid = magic == b"GS" and size == len(datagram) and crc == CRC(payload) and named == command_id
    return payload if valid else None


def is_hit(datagram: bytes) -> bool:
    """Return whether a datagram is a valid bumper report of a pressed bumper."""
    return payload_of(datagram, BUMPER) == b"\1"


def velocity(datagram: bytes) -> tuple[float, float] | None:
    """Decode a velocity report, m/s and rad/s, forward or standing; None for other frames."""
    payload = payload_of(datagram, MOTION)
    if payload is None:
        return None
    linear_mmps, angular_ddegps = struct.unpack("<HH", payload)
    return linear_mmps / 1000, math.radians(angular_ddegps / 10)


def main() -> None:
    """Answer until killed."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", int(sys.argv[1])))
    stop, brake = command(STOP), command(BREAK)
    while True:
        datagram, board = sock.recvfrom(2048)
        sock.sendto(brake if is_hit(datagram) else stop, board)


if __name__ == "__main__":
    main()
