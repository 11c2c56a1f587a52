"""Publish and subscribe over a real router: what arrives, and what is refused."""

import threading
from collections import Counter
from collections.abc import Callable

import msgpack
import zenoh

from common import clock
from common.bus.bus import Arrival, Bus, OverwritingQueue
from t2 import keys
from t2.errors import MessageError
from t2.messages import Bumper, Drive, Event, ResetRequest
from tests.common.bus_fixture import BusFixture, until_received
from verification.harness.bus import at
from verification.harness.waiting import wait_until


def bumper(buses: BusFixture) -> str:
    """Return the key of this robot's bumper."""
    return keys.BUMPER.on(buses.robot)


def test_a_message_arrives_with_header_key_time_and_raw_frame(buses: BusFixture) -> None:
    """As plain MessagePack with its encoding and class of service."""
    received: list[Arrival[Bumper]] = []
    samples: list[zenoh.Sample] = []
    buses.bus(lambda bus: bus.subscribe(keys.BUMPER, received.append, depth=9))
    subscriber = buses.session().declare_subscriber(bumper(buses), samples.append)
    sender = buses.bus()
    publisher = sender.publisher(keys.BUMPER)
    before_ns = clock.now_ns()
    until_received(
        lambda: publisher.put(Bumper(pressed=True), b"GS\t\0"), lambda: received and samples, "it"
    )
    subscriber.undeclare()
    assert msgpack.unpackb(samples[0].payload.to_bytes())["pressed"] is True
    assert str(samples[0].encoding) == "application/msgpack;t2.v1.Bumper"
    assert samples[0].priority == zenoh.Priority.DATA_HIGH
    assert samples[0].congestion_control == zenoh.CongestionControl.DROP
    arrival = received[0]
    assert arrival.message.pressed
    assert arrival.message.boot == sender.boot
    assert arrival.key == bumper(buses)
    assert arrival.raw == b"GS\t\0"
    assert before_ns < arrival.message.mono_ns < arrival.received_ns < clock.now_ns()


def test_every_source_arrives_of_this_robot_alone_and_all_are_counted_together(
    buses: BusFixture,
) -> None:
    received: set[str] = set()

    def take(arrival: Arrival[Drive]) -> None:
        received.add(arrival.key)

    receiver = buses.bus(lambda bus: bus.subscribe(keys.DRIVE, take, depth=100, source="*"))
    stranger = buses.session()
    payload = msgpack.packb({"linear": 0.1, "angular": 0.0, "echo": 0})
    names = ["nav", *(f"made up {number}" for number in range(50))]
    ours = [keys.DRIVE.on(buses.robot, source=name) for name in names]

    def put() -> None:
        for key in (keys.DRIVE.on(f"{buses.robot}x", source="web"), "t2/**", *ours):
            stranger.put(key, payload)

    until_received(put, lambda: len(received) == len(ours), "all sources")
    assert received == set(ours)
    everyone = keys.DRIVE.on(buses.robot, source="*")
    assert set(receiver.counts) == {everyone}
    assert receiver.counts[everyone] >= len(ours)


def test_what_is_no_message_is_refused_counted_and_harmless(buses: BusFixture) -> None:
    received: list[Arrival[Bumper]] = []
    refused: list[tuple[str, MessageError]] = []

    def declare(bus: Bus) -> None:
        bus.subscribe(
            keys.BUMPER, received.append, depth=64, refused=lambda *why: refused.append(why)
        )
        bus.subscribe(keys.EVENTS, lambda _: None, service="*")  # nobody asks what was refused

    receiver = buses.bus(declare)
    stranger = buses.session()
    until_received(lambda: stranger.put(bumper(buses), b""), lambda: refused, "the first")
    count = len(refused)
    wait = zenoh.CongestionControl.BLOCK  # what is dropped on the way is not refused
    stranger.put(
        bumper(buses), msgpack.packb({"pressed": "x" * 1_000_000}), congestion_control=wait
    )
    stranger.delete(bumper(buses), congestion_control=wait)
    wait_until(lambda: len(refused) >= count + 2, "all of them")
    stranger.put(bumper(buses), msgpack.packb({"pressed": True, "later": {"a": [1]}}))
    wait_until(lambda: received, "a good one after them")
    assert [arrival.message.pressed for arrival in received] == [True]
    assert {key for key, _ in refused} == {bumper(buses)}
    assert receiver.counters["undecodable"] == len(refused)
    until_received(
        lambda: stranger.put(keys.EVENTS.on(buses.robot, service="x"), b"\xc1"),
        lambda: receiver.counters["undecodable"] > len(refused),
        "a refusal that nobody asked for",
    )


def test_a_handler_that_is_behind_gets_the_newest(buses: BusFixture) -> None:
    depth = 4
    received: list[int] = []
    receiver = buses.bus(
        lambda bus: bus.subscribe(
            keys.BUMPER, lambda a: received.append(a.message.seq), depth=depth
        )
    )
    publisher = buses.bus().publisher(keys.BUMPER)
    until_received(lambda: publisher.put(Bumper(pressed=False)), lambda: received, "the first")
    with buses.stalled():
        for _ in range(30):
            publisher.put(Bumper(pressed=False))
        wait_until(lambda: receiver.counters["overrun"] >= 30 - depth, "what had to go")
    last = publisher._seq
    wait_until(lambda: received[-1] == last, "the newest")
    assert received[-depth:] == list(range(last - depth + 1, last + 1))
    publisher.put(Bumper(pressed=False))
    wait_until(lambda: received[-1] == last + 1, "the one after")


def test_an_item_that_comes_during_a_turn_is_of_the_next_turn() -> None:
    """Also the newest one is never left in the queue, and a flood does not hold the owner."""
    taken: list[int] = []
    posted: list[Callable[[], None]] = []

    def take(item: int) -> None:
        taken.append(item)
        if item < 3:
            queue.put(item + 1)

    queue = OverwritingQueue(3, take, posted.append, Counter())
    queue.put(0)
    for turn in range(4):
        posted.pop()()
        assert taken == list(range(turn + 1))
    assert not posted


def test_any_put_and_any_delete_is_an_emergency_stop(buses: BusFixture) -> None:
    stops: list[int] = []
    buses.bus(lambda bus: bus.on_any(keys.estop_key(buses.robot), stops.append))
    other, stranger = buses.bus(), buses.session()
    one, fleet = keys.estop_key(buses.robot), keys.estop_key("*")
    ways: list[Callable[[], object]] = [
        other.estop,
        lambda: stranger.put(one, b""),
        lambda: stranger.put(one, b"\xc1" * 1_000_000),
        lambda: stranger.put(fleet, "stop!"),
        lambda: stranger.put(keys.estop_key(f"{buses.robot[0]}$*"), b""),
        lambda: stranger.put("t2/**", b""),
        lambda: stranger.delete(one),
        lambda: stranger.delete(fleet),
    ]
    for way in ways:
        count = len(stops)
        until_received(way, lambda count=count: len(stops) > count, "a stop")  # type: ignore[misc]
    assert all(isinstance(received_ns, int) for received_ns in stops)


def test_late_joiners_get_the_events_that_were(buses: BusFixture) -> None:
    names = [f"event_{number}" for number in range(20)]
    bus = Bus(at(buses.endpoint), buses.robot, buses.loop.post)
    publisher = bus.publisher(keys.EVENTS, service="bridge")

    def emit(text: str) -> None:
        publisher.put(Event(name="stop", level="info", text=text))

    for name in names[:10]:
        emit(name)  # before there is a session
    buses.opened(bus)
    for name in names[10:]:
        emit(name)
    received: list[str] = []

    def hear(arrival: Arrival[Event]) -> None:
        received.append(arrival.message.text)

    buses.bus(lambda bus: bus.subscribe(keys.EVENTS, hear, depth=128, service="*"))
    wait_until(lambda: len(received) >= 20, "the events that were")
    emit("one more")
    wait_until(lambda: "one more" in received, "the next one")
    assert received == [*names, "one more"]


def test_a_closed_bus_calls_nobody_and_hurts_nobody(buses: BusFixture) -> None:
    received: list[Arrival[Bumper]] = []
    receiver = buses.bus(lambda bus: bus.subscribe(keys.BUMPER, received.append, depth=8))
    publisher = buses.bus().publisher(keys.BUMPER)
    until_received(lambda: publisher.put(Bumper(pressed=False)), lambda: received, "the first")
    with buses.stalled():
        count = receiver.counts[bumper(buses)]
        publisher.put(Bumper(pressed=True))
        wait_until(lambda: len(buses.loop._posted) > 0, "a sample that waits")
        receiver.close()
    done = threading.Event()
    buses.loop.post(done.set)
    assert done.wait(20)
    assert receiver.counts[bumper(buses)] == count
    assert not receiver.connected
    receiver.estop()
    receiver.call(keys.RESET, ResetRequest(), print, print)
    receiver.close()
    assert receiver.publisher(keys.BUMPER).put(Bumper(pressed=False)).seq == 1


def test_a_session_that_is_found_but_not_taken_over_is_closed(buses: BusFixture) -> None:
    posted: list[Callable[[], None]] = []
    bus = Bus(at(buses.endpoint), buses.robot, posted.append)
    bus.live(keys.live_key(buses.robot, "bridge", "1"))
    bus.open()
    wait_until(lambda: posted, "a session")
    (session,) = bus.sessions
    bus.close()
    for call in posted:
        call()
    assert session._found is not None
    assert session._found.is_closed()
    assert not bus.connected
