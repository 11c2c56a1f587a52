"""Print the vehicle's pose with eclipse-zenoh and msgpack only.

python examples/watch_plain.py [tcp/127.0.0.1:7447]

The interface is docs/bus.md; any language with both libraries can do the same.
"""

import json
import signal
import sys

import msgpack
import zenoh

signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends it without a traceback
endpoint = sys.argv[1] if len(sys.argv) > 1 else "tcp/127.0.0.1:7447"
config = zenoh.Config.from_json5(
    json.dumps({"mode": "client", "connect": {"endpoints": [endpoint]}})
)

with zenoh.open(config) as session:
    odometry = session.declare_subscriber(
        "t2/v1/001/tel/odom/odometry", zenoh.handlers.RingChannel(1)
    )
    for sample in odometry:
        pose = msgpack.unpackb(sample.payload.to_bytes())
        print(f"x {pose['x']:6.2f} m  y {pose['y']:6.2f} m  {pose['linear']:5.2f} m/s", flush=True)
