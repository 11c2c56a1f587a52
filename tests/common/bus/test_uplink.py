"""The uplink of a robot's router: visible to the site, hidden from other robots."""

from contextlib import ExitStack

import zenoh

from common import keys
from common.bus.bus import Arrival, Bus
from common.bus.session import client_config, router
from common.messages import Bumper, Event, ResetDone, ResetRequest
from tests.common.bus_fixture import BusFixture, until_received
from verification.harness.bus import at, listening
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until


def somewhere() -> str:
    """Return an endpoint where nobody listens yet."""
    return f"tcp/127.0.0.1:{free_port()}"


class Onboard:
    """The bus clients on a robot."""

    def __init__(self, buses: BusFixture) -> None:
        self.stops: list[int] = []
        self.bus = buses.bus(self.declare)
        self.bumper = self.bus.publisher(keys.BUMPER)
        events = self.bus.publisher(keys.EVENTS, service="safety")
        events.put(Event(name="old", level="info", text="before the site was there"))

    def declare(self, bus: Bus) -> None:
        bus.on_any(keys.estop_key(bus.robot), self.stops.append)
        bus.serve(keys.RESET, lambda _, caller: caller.reply(ResetDone(text="done")))
        bus.live(keys.live_key(bus.robot, "safety", "1"))

    def put(self) -> None:
        self.bumper.put(Bumper(pressed=True))


class Room:
    """A client at the site."""

    def __init__(self, buses: BusFixture) -> None:
        self.received: list[Arrival[Bumper]] = []
        self.late: list[str] = []
        self.tokens: list[str] = []
        self.replies: list[ResetDone] = []
        self.bus = buses.bus(self.declare)

    def declare(self, bus: Bus) -> None:
        bus.subscribe(keys.BUMPER, self.received.append)
        bus.subscribe(
            keys.EVENTS, lambda a: self.late.append(a.message.name), depth=99, service="*"
        )
        bus.watch_live(keys.live_key("berlin-$*", "*", "*"), lambda key, _: self.tokens.append(key))

    def request(self) -> None:
        self.bus.call(keys.RESET, ResetRequest(), self.replies.append, print)


def test_a_site_sees_asks_and_stops_a_robot_whoever_starts_anew(buses: BusFixture) -> None:
    site, own = somewhere(), somewhere()
    buses.endpoint, buses.robot = own, "berlin-007"
    with router(listening(own, site)):  # which does without the site's
        onboard = Onboard(buses)
        for _ in range(2):  # the site's is restarted in between
            onboard.stops.clear()
            with router(listening(site)), zenoh.open(client_config(at(site))) as session:
                buses.endpoint = site
                room = Room(buses)
                until_received(onboard.put, lambda r=room: r.received, "a bumper")  # type: ignore[misc]
                wait_until(lambda r=room: r.tokens, "the token")  # type: ignore[misc]
                wait_until(lambda r=room: r.late, "the event")  # type: ignore[misc]
                until_received(room.request, lambda r=room: r.replies, "a reply")  # type: ignore[misc]
                until_received(
                    lambda s=session: s.put(keys.estop_key("berlin-$*"), b""),  # type: ignore[misc]
                    lambda: onboard.stops,
                    "a stop",
                )
                room.bus.close()


def test_robots_do_not_hear_each_other(buses: BusFixture) -> None:
    """So the declarations of one cost the others nothing, and none can drive another."""
    site, first, second = somewhere(), somewhere(), somewhere()
    with ExitStack() as stack:
        for where in (listening(site), listening(first, site), listening(second, site)):
            stack.enter_context(router(where))
        one, other, room = (
            stack.enter_context(zenoh.open(client_config(at(e)))) for e in (first, second, site)
        )
        received: list[str] = []
        seen: list[str] = []
        subscribers = [
            other.declare_subscriber("t2/**", lambda sample: received.append(str(sample.key_expr))),
            room.declare_subscriber("t2/**", lambda sample: seen.append(str(sample.key_expr))),
        ]
        until_received(lambda: one.put("t2/v1/a/tel/x", b""), lambda: seen, "what the site sees")
        until_received(
            lambda: room.put("t2/v1/a/tel/end", b""),
            lambda: "t2/v1/a/tel/end" in received,
            "the end",
        )
        assert set(received) == {"t2/v1/a/tel/end"}
        for subscriber in subscribers:
            subscriber.undeclare()
