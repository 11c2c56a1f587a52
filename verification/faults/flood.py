"""``python -m verification.faults.flood PORT``: send 20 000 datagrams/s to a port."""

import contextlib
import socket
import sys
import time

PER_MS = 20


def main() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.connect(("127.0.0.1", int(sys.argv[1])))
        due_s = time.monotonic()
        while True:
            for _ in range(PER_MS):
                with contextlib.suppress(OSError):
                    sock.send(b"GS" + bytes(20))
            due_s = max(due_s + 0.001, time.monotonic() - 0.1)
            time.sleep(max(0.0, due_s - time.monotonic()))


if __name__ == "__main__":
    main()
