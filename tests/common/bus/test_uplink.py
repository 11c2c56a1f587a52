"""The uplink of a robot's router: visible to the site, hidden from other robots."""

from contextlib import ExitStack

import zenoh

from common.bus.session import client_config, router
from t2 import keys
from tests.common.bus_fixture import until_received
from verification.harness.bus import at, listening
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until


class Client:
    """A session on a router, and what it receives."""

    def __init__(self, stack: ExitStack, endpoint: str) -> None:
        self.session = stack.enter_context(zenoh.open(client_config(at(endpoint))))
        self.received: set[str] = set()
        self.subscribers = [
            self.session.declare_subscriber("t2/**", self.take),
            self.session.liveliness().declare_subscriber("t2/**", self.take, history=True),
        ]
        stack.callback(lambda: [each.undeclare() for each in self.subscribers])

    def take(self, sample: zenoh.Sample) -> None:
        self.received.add(str(sample.key_expr))

    def put_until(self, key: str, other: "Client") -> None:
        """Publish until the other one has it: samples before all declarations are lost."""
        arrived = [str(zenoh.KeyExpr(key))]
        until_received(
            lambda: self.session.put(key, b""), lambda: set(arrived) <= other.received, key
        )


def test_a_site_sees_and_stops_its_robots_which_do_not_receive_each_other() -> None:
    """So the declarations of one cost the others nothing, and none can drive another."""
    site, first, second = (f"tcp/127.0.0.1:{free_port()}" for _ in range(3))
    measured, token = "t2/v1/berlin-1/tel/x", keys.live_key("berlin-1", "safety", "1")
    with ExitStack() as stack:
        for where in (listening(first, site), listening(second, site)):  # before the site is up
            stack.enter_context(router(where))
        one, other = Client(stack, first), Client(stack, second)
        alive = one.session.liveliness().declare_token(token)
        for _ in range(2):  # the site's router is restarted in between
            with router(listening(site)), ExitStack() as visit:
                room = Client(visit, site)
                one.put_until(measured, room)
                wait_until(lambda r=room: token in r.received, "the token")  # type: ignore[misc]
                for robot in (one, other):
                    room.put_until(keys.estop_key("berlin-$*"), robot)
                    robot.received.discard(keys.estop_key("berlin-$*"))
        assert not {measured, token} & other.received
        alive.undeclare()
