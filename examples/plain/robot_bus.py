"""T2's bus with eclipse-zenoh and msgpack: the session, the newest message, requests to safety."""

import os
import sys
import time

import msgpack
import zenoh

ROOT = "t2/v1/001"  # 001: the robot's id


def open_session():
    """Connect to an endpoint, or as a Zenoh configuration file (.json5) describes."""
    router = sys.argv[1] if len(sys.argv) > 1 else "tcp/127.0.0.1:7447"
    if router.endswith(".json5"):
        return zenoh.open(zenoh.Config.from_file(router))
    config = zenoh.Config.from_json5(
        f'{{mode: "client", connect: {{endpoints: ["{router}"], timeout_ms: 3000}},'
        " scouting: {multicast: {enabled: false}}}"
    )
    return zenoh.open(config)


class Newest:
    """The newest message of a key: older ones are dropped, so a slow reader never falls behind."""

    def __init__(self, session, path):
        ring = zenoh.handlers.RingChannel(1)
        self._subscriber = session.declare_subscriber(f"{ROOT}/{path}", ring)

    def take(self):
        """Return the message that arrived since the last call, or None."""
        sample = self._subscriber.try_recv()
        return msgpack.unpackb(sample.payload.to_bytes()) if sample else None


class Source:
    """Publisher of one source's requests to safety; `kind` is drive or limit."""

    def __init__(self, session, kind, name):
        self.state = None  # the newest tel/safety/state; None while safety is silent
        self._received = 0.0  # monotonic time in s, of that state
        self._states = Newest(session, "tel/safety/state")
        self._publisher = session.declare_publisher(
            f"{ROOT}/@cmd/{kind}/{name}",
            priority=zenoh.Priority.INTERACTIVE_HIGH,
            congestion_control=zenoh.CongestionControl.DROP,
            express=True,
        )
        self._boot = int.from_bytes(os.urandom(7), "big")  # random per start
        self._seq = 0

    def put(self, **fields):
        """Put a request; safety refuses it when the heartbeat that it echoes is old."""
        now = time.monotonic()
        if state := self._states.take():
            self.state, self._received = state, now
        elif now - self._received > 0.5:
            self.state = None
        self._seq += 1
        header = {
            "seq": self._seq,
            "boot": self._boot,
            "t_ns": time.time_ns(),  # for recordings
            "echo": self.state["heartbeat"] if self.state else 0,
        }
        self._publisher.put(msgpack.packb(header | fields))
