"""``python -m bench.path.background_consumer CONFIG MS``: subscribe to everything, MS per sample.

It blocks Zenoh's own thread meanwhile, so that unread samples wait in the link and not in a queue.
"""

import sys
import threading
import time

import msgpack
import zenoh

from common import keys

EVERYTHING = (f"{keys.ROOT}/001/**", f"{keys.ROOT}/001/@cmd/**")


def main(config: str, ms: float) -> None:
    """Receive until killed."""

    def take(sample: zenoh.Sample) -> None:
        if sample.payload:
            msgpack.unpackb(sample.payload.to_bytes())
        time.sleep(ms / 1000)

    with zenoh.open(zenoh.Config.from_json5(config)) as session:
        callback = zenoh.handlers.Callback(take, indirect=False)
        declared = [session.declare_subscriber(key, callback) for key in EVERYTHING]
        threading.Event().wait()
        del declared


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
