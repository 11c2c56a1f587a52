"""``python -m bench.path.background_consumer CONFIG``: subscribe to everything and decode it."""

import sys
import threading

import msgpack
import zenoh

from common import keys

EVERYTHING = (f"{keys.ROOT}/001/**", f"{keys.ROOT}/001/@cmd/**")


def main(config: str) -> None:
    """Receive until killed."""

    def take(sample: zenoh.Sample) -> None:
        if sample.payload:
            msgpack.unpackb(sample.payload.to_bytes())

    with zenoh.open(zenoh.Config.from_json5(config)) as session:
        callback = zenoh.handlers.Callback(take, indirect=False)
        declared = [session.declare_subscriber(key, callback) for key in EVERYTHING]
        threading.Event().wait()
        del declared


if __name__ == "__main__":
    main(sys.argv[1])
