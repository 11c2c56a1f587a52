"""``python -m bench.reaction.loop PORT``: one process, one loop over a socket, nothing else.

What somebody writes in an hour: it knows frames and CRC, answers a bumper hit with BREAK and
everything else with STOP.
"""

import socket
import struct
import sys

import crcmod.predefined

CRC = crcmod.predefined.mkCrcFun("crc-16")
HEADER = struct.Struct("<2sHHH")
BUMPER, MOTION = 0x7602, 0x7426
STOP, BREAK = 0, 2


def command(kind: int) -> bytes:
    """Return a motion frame that does not move."""
    payload = struct.pack("<BHH", kind, 0, 0)
    return HEADER.pack(b"GS", HEADER.size + len(payload), MOTION, CRC(payload)) + payload


def is_hit(datagram: bytes) -> bool:
    """Tell whether a datagram is a sound bumper report that says pressed."""
    if len(datagram) < HEADER.size:
        return False
    magic, size, name, crc = HEADER.unpack_from(datagram)
    payload = datagram[HEADER.size : size]
    sound: bool = magic == b"GS" and size == len(datagram) and crc == CRC(payload)
    return sound and name == BUMPER and payload == b"\1"


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
