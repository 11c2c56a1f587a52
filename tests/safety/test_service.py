"""The shell in this process: what goes in and what comes out of one loop."""

import contextlib
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest
import zenoh
from msgspec.structs import replace

from common import clock, realtime
from common.bus.bus import Arrival, Bus
from common.bus.drive import DriveLink
from common.bus.session import client_config
from common.config import Sources, load
from common.freshness import NS_PER_S
from common.loop import Loop
from common.motion import BRAKE, RUN, STOP
from common.service import Node
from services.safety import __main__ as program
from services.safety.config import SafetyConfig
from services.safety.core.inputs import DriveRequest
from services.safety.service import SafetyService
from t2 import keys
from t2.client import reset_request
from t2.messages import Bumper, Drive, Motion, Phrase, Refusal, ResetRequest, SafetyState, Velocity
from tests.common.bus_fixture import until_received
from tests.factories import safety_state
from verification.harness.bus import at, joined, router_process, running
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

ROBOT = "berlin-007"


def make_node(endpoint: str, *sets: str) -> Node[SafetyConfig]:
    here = f"bus.connect={endpoint}", f"robot.id={ROBOT}"
    return Node("safety", load(SafetyConfig, Sources(environ={}, sets=[*here, *sets])))


@contextlib.contextmanager
def safety_on(endpoint: str, of_estop: str = "") -> Iterator[Node[SafetyConfig]]:
    """Run a safety service; its emergency stop's session may have another router."""
    node = make_node(endpoint)
    reader = Bus(at(of_estop or endpoint), ROBOT, node.loop.post)
    node.buses.append(reader)
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
class Safety:
    """A safety service, a bus that plays the bridge, a client of the router, and what came."""

    node: Node[SafetyConfig]
    session: zenoh.Session
    motions: list[Motion] = field(default_factory=list)
    states: list[SafetyState] = field(default_factory=list)
    drive: DriveLink = field(init=False)
    bus: Bus = field(init=False)

    def watch(self, bus: Bus) -> None:
        self.bus, self.drive = bus, DriveLink(bus, listens=True)
        bus.subscribe(keys.MOTION, lambda it: self.motions.append(it.message), depth=64)
        bus.subscribe(keys.SAFETY, lambda it: self.states.append(it.message), depth=64)

    @property
    def brakes(self) -> bool:
        return bool(self.motions) and self.motions[-1].command == "brake"


@pytest.fixture
def safety(shared_router: str) -> Iterator[Safety]:
    with (
        running(Loop()) as loop,
        safety_on(shared_router) as node,
        zenoh.open(client_config(at(shared_router))) as session,
    ):
        made = Safety(node, session)
        with joined(at(shared_router), ROBOT, loop, made.watch):
            yield made


def test_two_routers_leave_the_path_of_the_emergency_stop_unproven(shared_router: str) -> None:
    other = f"tcp/127.0.0.1:{free_port()}"
    with (
        router_process(other),
        running(Loop()) as loop,
        safety_on(shared_router, other) as node,
        zenoh.open(client_config(at(shared_router))) as session,
    ):
        made = Safety(node, session)
        with joined(at(shared_router), ROBOT, loop, made.watch):
            streams: list[tuple[Any, Any]] = [
                (made.drive.publisher(topic), message)
                for topic, message in (
                    (keys.VELOCITY, Velocity(linear=0.0, angular=0.0)),
                    (keys.BUMPER, Bumper(pressed=False)),
                )
            ]

            def missing() -> str:
                for publisher, message in streams:
                    publisher.put(message)
                causes = made.states[-1].causes if made.states else ()
                return next((one.text for one in causes if one.name == "starting"), "")

            wait_until(lambda: "velocity" not in (text := missing()) and text, "the samples")
            count = len(made.states)
            wait_until(lambda: missing() and len(made.states) > count + 20, "more states")
            assert "the path of the emergency stop" in missing()


def test_it_stops_from_the_beginning_judges_a_hit_and_answers_calls(safety: Safety) -> None:
    wait_until(lambda: len(safety.motions) > 20 and len(safety.states) > 5, "a stream of both")
    assert "run" not in {motion.command for motion in safety.motions}
    beats = [state.heartbeat for state in safety.states]
    assert beats == sorted(set(beats))
    bumper, velocity = (safety.drive.publisher(each) for each in (keys.BUMPER, keys.VELOCITY))
    until_received(
        lambda: (velocity.put(Velocity(linear=0.0, angular=0.0)), bumper.put(Bumper(pressed=True))),
        lambda: safety.brakes,
        "the brake",
    )
    assert safety.motions[-1].judged_boot == safety.bus.boot
    wait_until(lambda: safety.states[-1].release, "a latched contact")
    answers: list[str] = []

    def refused(refusal: Refusal) -> None:
        answers.append(refusal.text)

    request = reset_request(safety.states[-1])
    safety.bus.call(keys.RESET, request, lambda done: answers.append(done.text), refused)
    wait_until(lambda: answers, "an answer")
    assert "Still present" in answers[0]
    wait_until(safety.node.is_stopped, "rest")
    wait_until(lambda: "leaving" in {c.name for c in safety.states[-1].causes}, "leaving")


def test_refused_requests_are_counted_by_their_reason(safety: Safety) -> None:
    drive, other = (safety.bus.publisher(keys.DRIVE, source=name) for name in ("demo", "nobody"))
    key = keys.DRIVE.on(ROBOT, source="demo")
    wanted = {"refused_late", "refused_unknown_source", "refused_not_a_request"}
    until_received(
        lambda: (
            drive.put(Drive(linear=0.0, angular=0.0, echo=-1)),
            other.put(Drive(linear=0.0, angular=0.0, echo=-1)),
            safety.session.put(key, b"\xc1"),
            safety.session.delete(key),
        ),
        lambda: wanted <= set(safety.node.counters),
        "every reason",
    )


@pytest.mark.parametrize("robots", [ROBOT, "berlin-$*", "*"])
def test_an_estop_by_delete_for_one_a_site_or_all_latches(safety: Safety, robots: str) -> None:
    until_received(
        lambda: safety.session.delete(keys.estop_key(robots)),
        lambda: safety.states and "estop" in safety.states[-1].latched,
        "a latched emergency stop",
    )


def test_what_the_bridge_measures_is_not_taken_from_the_router(safety: Safety) -> None:
    measured = [topic for topic in keys.TOPICS if topic.publisher == "bridge"]
    until_received(
        lambda: [
            safety.session.put(topic.on(ROBOT, side=side), b"\xc1")
            for topic in measured
            for side in ("left", "right")
        ],
        lambda: safety.node.bus.counts[keys.MOTION.on(ROBOT)] > 50,
        "a second",
    )
    assert safety.node.bus.counters["undecodable"] == 0
    bumper = safety.drive.publisher(keys.BUMPER)
    until_received(
        lambda: bumper.put(Bumper(pressed=True)),
        lambda: safety.brakes,
        "what comes by the drive link",
    )


# --- without a bus ------------------------------------------------------------------------------


def test_the_emergency_stop_has_a_session_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(
        _: str,
        root: object,
        build: Callable[[Node[SafetyConfig]], None],
        argv: object,
        *,
        priority: int,
    ) -> int:
        assert priority == realtime.SAFETY
        unsafe = "safety.margin=0.0", 'unsafe_overrides=["safety.margin"]'
        node = make_node("tcp/127.0.0.1:1", *unsafe)
        build(node)
        assert [len(bus.sessions) for bus in node.buses] == [2, 1]  # one is the drive link
        node.loop.close()
        return 5

    monkeypatch.setattr(program, "run", run)
    assert program.main([]) == 5


@pytest.fixture
def service() -> Iterator[SafetyService]:
    node = make_node("tcp/127.0.0.1:1")
    with contextlib.closing(node.loop):
        yield SafetyService(node, node.open_bus())


def test_only_its_own_state_shows_that_an_emergency_stop_would_arrive(
    service: SafetyService,
) -> None:
    own = service._node.bus.boot
    for boot, counts in ((own + 1, False), (own, True)):
        service._on_estop_path(Arrival(replace(safety_state(), boot=boot), "", 1, None))
        assert (service._inputs.estop_path is not None) is counts


class Refusing:
    """A caller of a reset."""

    def __init__(self) -> None:
        self.answers: list[Phrase] = []

    def refuse(self, *reasons: Phrase) -> None:
        self.answers += reasons


@pytest.fixture
def sent(service: SafetyService, monkeypatch: pytest.MonkeyPatch) -> list[Motion]:
    """Return the motions that leave from now on."""
    motions: list[Motion] = []
    monkeypatch.setattr(service._motion_publisher, "put", motions.append)
    return motions


def test_a_flood_raises_neither_decisions_nor_motions(
    service: SafetyService, sent: list[Motion], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of known and unknown sources, of emergency stops and resets, between 50 decisions."""
    before, caller = service._state.decision, Refusing()
    events: list[str] = []
    monkeypatch.setattr(service._node, "event", lambda name, *_, **__: events.append(name))
    monkeypatch.setattr(clock, "now_ns", lambda: 10 * NS_PER_S)
    drive = Drive(linear=0.5, angular=0.0, echo=service._state.heartbeat.number, boot=1)
    for tick in range(50):
        service._on_tick(0)
        for seq in range(20):
            message = replace(drive, linear=0.5 * (seq % 2), seq=20 * tick + seq + 1)
            for source, request in (("teleop", message), ("nobody", message), ("teleop", None)):
                service._accept(DriveRequest(source, request, clock.now_ns()))
            service._on_estop()
            service._on_reset(ResetRequest(), caller)  # type: ignore[arg-type]
    assert service._state.decision - before == 50 + 1 + 50  # ticks, the first stop, resets
    assert 50 <= len(sent) <= 51
    assert service._node.counters["refused_unknown_source"] == 1000
    assert caller.answers.count(Phrase("reset.pending")) == 50 * 19
    assert events.count("reset_refused") == 1
    assert "estop" in service._state.latches


def test_a_more_severe_motion_leaves_at_once_and_takes_the_next_turn(
    service: SafetyService, sent: list[Motion]
) -> None:
    sent.clear()
    run, stop, brake = (Motion(command=each, judged=0) for each in (RUN, STOP, BRAKE))
    for motion, is_tick, leaves in (
        (run, False, False),  # less severe than the STOP before it
        (run, True, True),
        (run, False, False),
        (stop, False, True),
        (run, False, False),
        (stop, True, False),  # the STOP has taken its turn
        (run, True, True),
        (stop, False, True),
        (stop, False, False),
        (brake, False, True),
        (brake, True, False),
        (stop, True, True),
        (brake, True, True),
        (stop, True, True),
    ):
        before = len(sent)
        service._send(motion, is_tick=is_tick)
        assert sent[before:] == [motion] * leaves


def test_a_new_hit_under_a_brake_is_acknowledged_at_once(
    service: SafetyService, sent: list[Motion]
) -> None:
    """The bridge waits for it; a hit that is held is no new one."""
    for seq, (pressed, leave) in enumerate(
        [(True, 1), (True, 0), (False, 0), (True, 1), (True, 0)], 1
    ):
        before = len(sent)
        bumper = Bumper(pressed=pressed, seq=seq, boot=5)
        service._on_bumper(Arrival(bumper, "", clock.now_ns(), None))
        assert [motion.judged for motion in sent[before:]] == [seq] * leave
        service._on_tick(0)  # takes the turn back


def test_a_contact_that_chatters_neither_adds_motions_nor_silences_safety(
    service: SafetyService, sent: list[Motion]
) -> None:
    for seq in range(1, 65):  # the queue after a stall
        bumper = Bumper(pressed=bool(seq % 2), seq=seq, boot=5)
        service._on_bumper(Arrival(bumper, "", clock.now_ns(), None))
    assert len(sent) == 1
    for _ in range(2):
        service._on_tick(0)
    assert [motion.judged for motion in sent] == [1, 64]


def test_bumper_samples_without_news_are_decided_on_in_time_and_not_one_by_one(
    service: SafetyService,
) -> None:
    def decisions(seq: int, *, pressed: bool = False, boot: int = 5) -> int:
        before = service._state.decision
        bumper = Bumper(pressed=pressed, seq=seq, boot=boot)
        service._on_bumper(Arrival(bumper, "", clock.now_ns(), None))
        return service._state.decision - before

    assert [decisions(seq) for seq in range(1, 9)] == [0, 0, 1, 0, 0, 1, 0, 0]
    assert [decisions(9, pressed=True), decisions(10, pressed=True)] == [1, 0]
    assert [decisions(11), decisions(12)] == [1, 0]


@pytest.mark.parametrize(("gap_ns", "stops"), [(70_000_000, False), (70_000_001, True)])
def test_a_gap_between_bumper_samples_stops_without_a_decision_in_it(
    service: SafetyService, gap_ns: int, stops: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A press of 60 ms may hide in it."""
    now_ns = clock.now_ns()
    monkeypatch.setattr(clock, "now_ns", lambda: now_ns)
    for seq in (1, 2):
        arrival = Arrival(Bumper(pressed=False, seq=seq, boot=5), "", now_ns, None)
        service._on_bumper(arrival)
        now_ns += gap_ns
    assert ("bumper" in service._state.latches) is stops
