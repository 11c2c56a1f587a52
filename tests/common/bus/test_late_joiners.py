"""Late joiners and presence over a real router: what is replayed, and who is there."""

from collections.abc import Callable

from common import keys
from common.bus.bus import Arrival, Bus
from common.messages import Event
from tests.common.bus_fixture import BusFixture
from verification.harness.bus import at
from verification.harness.waiting import wait_until


def events(bus: Bus) -> Callable[[str], object]:
    """Return how to publish an event by its name."""
    publisher = bus.publisher(keys.EVENTS, service="bridge")
    return lambda name: publisher.put(Event(name=name, level="info", text=name))


def test_late_joiners_get_the_events_that_were(buses: BusFixture) -> None:
    names = [f"event_{number}" for number in range(20)]
    bus = Bus(at(buses.endpoint), buses.robot, buses.loop.post)
    emit = events(bus)
    for name in names[:10]:
        emit(name)  # before there is a session
    buses.opened(bus)
    for name in names[10:]:
        emit(name)
    received: list[str] = []

    def hear(arrival: Arrival[Event]) -> None:
        received.append(arrival.message.name)

    buses.bus(lambda bus: bus.subscribe(keys.EVENTS, hear, depth=128, service="*"))
    wait_until(lambda: len(received) >= 20, "the events that were")
    emit("one more")
    wait_until(lambda: "one more" in received, "the next one")
    assert received == [*names, "one more"]


def test_presence_appears_and_goes_and_late_watchers_see_it(buses: BusFixture) -> None:
    early: list[tuple[str, bool]] = []
    late: list[str] = []
    key, all_keys = (keys.live_key(buses.robot, *of) for of in (("bridge", "1a"), ("*", "*")))
    buses.bus(lambda bus: bus.watch_live(all_keys, lambda *what: early.append(what)))
    bus = buses.bus(lambda bus: bus.live(key))
    wait_until(lambda: (key, True) in early, "the token")
    buses.bus(lambda bus: bus.watch_live(all_keys, lambda key, _: late.append(key)))
    wait_until(lambda: key in late, "the token, late")
    bus.close()
    wait_until(lambda: (key, False) in early, "its end")
