"""``python -m bench.adapters NAME board PORT WHERE | NAME decide WHERE``: react to a bumper hit.

One process at the board, one that decides, and a bus between them. The first one reads the board's
datagrams and publishes each hit; the second one answers each hit; the first one then sends BRAKE.
To all other datagrams the first one answers STOP.
"""

import sys

from bench.adapters.protocols import BoardSocket, pair_adapter


def main(name: str, role: str, *given: str) -> None:
    """Run one of the two processes until killed."""
    adapter = pair_adapter(name)
    if role == "board":
        port, where = given
        adapter.board(BoardSocket(int(port)), where)
    else:
        (where,) = given
        adapter.decide(where)


if __name__ == "__main__":
    main(*sys.argv[1:])
