"""The shell in this process: what goes in and what comes out of one loop."""

import contextlib
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import pytest
import zenoh
from msgspec.structs import replace

from common import clock, codec, keys, realtime
from common.bus.bus import Arrival, Bus
from common.bus.drive import DriveLink
from common.bus.session import client_config
from common.client import reset_request
from common.config import Sources, load
from common.loop import Loop
from common.messages import (
    Bumper,
    Drive,
    Motion,
    SafetyState,
    Velocity,
)
from common.service import Node
from services.safety import __main__ as program
from services.safety.config import SafetyConfig
from services.safety.service import SafetyService
from tests.factories import safety_state
from verification.harness.bus import at, bus_on, running
from verification.harness.waiting import wait_until


def make_node(endpoint: str, *sets: str) -> Node[SafetyConfig]:
    sources = Sources(environ={}, sets=[f"bus.connect={endpoint}", *sets])
    return Node("safety", load(SafetyConfig, sources))


@contextlib.contextmanager
def safety_on(endpoint: str, *sets: str) -> Iterator[Node[SafetyConfig]]:
    node = make_node(endpoint, *sets)
    reader = node.open_bus()
    SafetyService(node, reader)
    with running(node.loop):
        node.open()
        wait_until(lambda: node.bus.connected and reader.connected, "both sessions")
        yield node
        closed = threading.Event()

        def close() -> None:
            for bus in (reader, node.bus):
                bus.close()
            closed.set()

        node.loop.post(close)  # where they are used: a put must not meet a session that ends
        wait_until(closed.is_set, "closed sessions")


@dataclass
class Seen:
    motions: list[Motion] = field(default_factory=list)
    states: list[SafetyState] = field(default_factory=list)
    answers: list[str] = field(default_factory=list)
    drive: DriveLink = field(init=False)

    def watch(self, bus: Bus) -> None:
        self.drive = DriveLink(bus, listens=True)
        bus.subscribe(keys.MOTION, self._motion, depth=64)
        bus.subscribe(keys.SAFETY, self._state, depth=64)

    def _motion(self, arrival: Arrival[Motion]) -> None:
        self.motions.append(arrival.message)

    def _state(self, arrival: Arrival[SafetyState]) -> None:
        self.states.append(arrival.message)


def repeat_until(do: Callable[[], object], true: Callable[[], object], what: str) -> None:
    """Do it again and again: samples right after a declaration may be lost."""

    def tried() -> object:
        do()
        return true()

    wait_until(tried, what)


def test_stop_is_published_from_the_beginning_and_the_heartbeat_rises(endpoint: str) -> None:
    loop, seen = Loop(), Seen()
    with running(loop), safety_on(endpoint), bus_on(endpoint, loop, seen.watch):
        wait_until(lambda: len(seen.motions) > 20 and len(seen.states) > 5, "a stream of both")
    assert "run" not in {motion.command for motion in seen.motions}
    beats = [state.heartbeat for state in seen.states]
    assert beats == sorted(set(beats))
    assert seen.states[0].text  # in words, whatever the reason is


def test_a_hit_brakes_and_is_judged_and_calls_are_answered(endpoint: str) -> None:
    loop, seen = Loop(), Seen()
    with (
        running(loop),
        safety_on(endpoint) as node,
        bus_on(endpoint, loop, seen.watch) as bus,
    ):
        bumper, velocity = (seen.drive.publisher(each) for each in (keys.BUMPER, keys.VELOCITY))
        repeat_until(
            lambda: (
                velocity.put(Velocity(linear=0.0, angular=0.0)),
                bumper.put(Bumper(pressed=True)),
            ),
            lambda: seen.motions and seen.motions[-1].command == "brake",
            "the brake",
        )
        assert seen.motions[-1].judged_boot == bus.boot
        wait_until(lambda: seen.states and seen.states[-1].release, "a latched contact")
        bus.call(
            keys.RESET,
            reset_request(seen.states[-1]),
            lambda done: seen.answers.append(done.text),
            seen.answers.append,
        )
        wait_until(lambda: seen.answers, "an answer")
        assert "Still present" in seen.answers[0]
        wait_until(node.is_stopped, "rest")
        wait_until(
            lambda: any(c.name == "leaving" for state in seen.states[-1:] for c in state.causes),
            "leaving",
        )


def test_refused_requests_are_counted_by_their_reason(endpoint: str) -> None:
    loop, seen = Loop(), Seen()
    with (
        running(loop),
        safety_on(endpoint) as node,
        bus_on(endpoint, loop, seen.watch) as bus,
        zenoh.open(client_config(at(endpoint))) as session,
    ):
        drive, other = (bus.publisher(keys.DRIVE, source=name) for name in ("demo", "nobody"))
        key = keys.DRIVE.on("001", source="demo")
        wanted = {"refused_late", "refused_unknown_source", "refused_not_a_request"}
        repeat_until(
            lambda: (
                drive.put(Drive(linear=0.0, angular=0.0, echo=-1)),
                other.put(Drive(linear=0.0, angular=0.0, echo=-1)),
                session.put(key, b"\xc1"),
                session.delete(key),
            ),
            lambda: wanted <= set(node.counters),
            "every reason",
        )


def test_an_estop_by_delete_latches(endpoint: str) -> None:
    loop, seen = Loop(), Seen()
    with (
        running(loop),
        safety_on(endpoint),
        bus_on(endpoint, loop, seen.watch),
        zenoh.open(client_config(at(endpoint))) as session,
    ):
        repeat_until(
            lambda: session.delete("t2/v1/001/estop"),
            lambda: seen.states and "estop" in seen.states[-1].latched,
            "a latched emergency stop",
        )


def test_only_its_own_state_shows_that_an_emergency_stop_would_arrive(endpoint: str) -> None:
    node = make_node(endpoint)
    with contextlib.closing(node.loop):
        service = SafetyService(node, node.open_bus())
        for boot, counts in ((node.bus.boot + 1, False), (node.bus.boot, True)):
            state = replace(safety_state(), boot=boot)
            service._on_estop_path(Arrival(state, "", 1, None))
            assert (service._inputs.estop_path is not None) is counts


@pytest.mark.parametrize("who", ["berlin-$*", "*"])
def test_an_estop_for_one_a_site_or_all_latches(endpoint: str, who: str) -> None:
    latched: list[tuple[str, ...]] = []
    with (
        safety_on(endpoint, "robot.id=berlin-007"),
        zenoh.open(client_config(at(endpoint))) as session,
    ):
        states = session.declare_subscriber(
            keys.SAFETY.on("berlin-007"),
            lambda sample: latched.append(
                codec.decode(sample.payload.to_bytes(), SafetyState).latched
            ),
        )
        repeat_until(
            lambda: session.put(keys.estop_key(who), b""),
            lambda: latched and "estop" in latched[-1],
            "a latched emergency stop",
        )
        states.undeclare()


def test_the_emergency_stop_has_a_session_of_its_own(
    endpoint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(
        name: str,
        root: object,
        build: Callable[[Node[SafetyConfig]], None],
        argv: object,
        *,
        priority: int,
    ) -> int:
        assert priority == realtime.SAFETY
        node = make_node(endpoint, "safety.margin=0.0", 'safety.unsafe_overrides=["margin"]')
        build(node)
        assert [len(bus.sessions) for bus in node.buses] == [2, 1]  # one is the drive link
        node.loop.close()
        return 5

    monkeypatch.setattr(program, "run", run)
    assert program.main([]) == 5


def test_what_the_bridge_measures_is_not_taken_from_the_router(endpoint: str) -> None:
    loop, seen = Loop(), Seen()
    with (
        running(loop),
        safety_on(endpoint) as node,
        bus_on(endpoint, loop, seen.watch),
        zenoh.open(client_config(at(endpoint))) as session,
    ):
        measured = [topic for topic in keys.TOPICS if topic.publisher == "bridge"]
        repeat_until(
            lambda: [
                session.put(topic.on("001", side=side), b"\xc1")
                for topic in measured
                for side in ("left", "right")
            ],
            lambda: node.bus.counts[keys.MOTION.on("001")] > 50,
            "a second",
        )
        assert node.bus.counters["undecodable"] == 0
        bumper = seen.drive.publisher(keys.BUMPER)
        repeat_until(
            lambda: bumper.put(Bumper(pressed=True)),
            lambda: seen.motions and seen.motions[-1].command == "brake",
            "what comes by the drive link",
        )


def test_bumper_samples_without_news_are_decided_on_in_time_and_not_one_by_one(
    endpoint: str,
) -> None:
    node = make_node(endpoint)
    with contextlib.closing(node.loop):
        service = SafetyService(node, node.open_bus())

        def decisions(seq: int, *, pressed: bool = False, lost: int = 0) -> int:
            before = service._state.decision
            bumper = Bumper(pressed=pressed, lost=lost, seq=seq, boot=5)
            service._on_bumper(Arrival(bumper, "", clock.now_ns(), None))
            assert "bumper" not in service._state.latches  # no sample seems lost
            return service._state.decision - before

        assert [decisions(seq) for seq in range(1, 9)] == [1, 0, 0, 1, 0, 0, 1, 0]
        assert [decisions(9, pressed=True), decisions(10, pressed=True)] == [1, 1]
        assert [decisions(11), decisions(12), decisions(13, lost=1)] == [1, 0, 1]
