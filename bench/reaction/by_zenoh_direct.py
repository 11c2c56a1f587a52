"""``python -m bench.reaction.by_zenoh_direct board PORT ENDPOINT | judge ENDPOINT``: no router.

The one at the board listens, the other dials, and each writes to the link in the thread that puts
(``lowlatency``): the least that Zenoh takes. Who puts then waits for a link that is full.
"""

import sys

import zenoh

from bench.reaction import by_zenoh

LEAST = {"transport": {"unicast": {"lowlatency": True, "qos": {"enabled": False}}}}


def listening(endpoint: str) -> zenoh.Session:
    """Return the session that the other one dials."""
    return by_zenoh.opened(LEAST | {"mode": "peer", "listen": {"endpoints": [endpoint]}})


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["board", port, endpoint]:
            by_zenoh.board(int(port), listening(endpoint))
        case ["judge", endpoint]:
            by_zenoh.judge(by_zenoh.joined(endpoint, LEAST))
