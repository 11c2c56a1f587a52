"""What must hold whatever happens: invariants 1 to 5, over random sequences of events.

The oracle shares nothing with the policy but the zones' formula: it keeps its own books from what
went in, and checks every verdict that comes out.
"""

import math
from collections.abc import Callable
from dataclasses import replace

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from common.freshness import S
from common.messages import Drive, Switches, Ultrasonic
from services.safety.inputs import Ask, Estop, Event, Reset
from services.safety.state import RELEASE, Verdict
from tests.safety.scene import Scene, link

AGES_S = {"bumper": 0.15, "velocity": 0.2, "link": 0.6, "left": 2.0, "right": 2.0, "switches": 3.0}


class Watched(Scene):
    """A scene whose every verdict is checked."""

    def __init__(self) -> None:
        self.latched = False
        self.accepted: dict[str, tuple[int, float, float]] = {}
        self.neutral: set[str] = set()
        self.runs = 0
        super().__init__()

    def decide(self, event: Event | None = None) -> Verdict:
        inputs = self.inputs
        verdict = super().decide(event)
        trips = [
            isinstance(event, Estop),
            self.state.reader_was_up and not self.reader,
            bool(inputs.bumper and inputs.bumper.value.pressed),
            bool(inputs.left and inputs.left.value.bits),
            bool(inputs.right and inputs.right.value.bits),
        ]
        if isinstance(event, Reset) and verdict.reply and verdict.reply.done:
            assert not any(trips)
            self.latched = False
        if any(trips):
            self.latched = True
        if self.latched or not self._inputs_are_good():
            self.neutral.clear()
        self._note(event, verdict)
        if verdict.command == "run" and not verdict.twist.is_zero:
            self._check_run(verdict)
        if verdict.command != "run":
            assert verdict.twist.is_zero
        return verdict

    def _note(self, event: Event | None, verdict: Verdict) -> None:
        if not isinstance(event, Ask) or verdict.refused:
            return
        assert event.drive is not None
        self.accepted[event.source] = (self.now_ns, event.drive.linear, event.drive.angular)
        if event.drive.linear == 0 == event.drive.angular:
            self.neutral.add(event.source)

    def _check_run(self, verdict: Verdict) -> None:
        self.runs += 1
        assert math.isfinite(verdict.twist.linear)
        assert math.isfinite(verdict.twist.angular)
        assert self._inputs_are_good()
        assert self.reader
        self._check_source(verdict)
        self._check_zones(verdict)

    def _check_source(self, verdict: Verdict) -> None:
        assert verdict.source is not None
        if verdict.source == RELEASE:
            assert self.pressed or self.muted
            assert abs(verdict.twist.linear) <= 0.1 + 1e-9
            return
        assert not self.latched
        at_ns, _, _ = self.accepted[verdict.source]
        lease_s = self.policy.settings.sources[verdict.source].lease
        assert self.now_ns - at_ns <= lease_s * S
        assert verdict.source in self.neutral

    def _check_zones(self, verdict: Verdict) -> None:
        zones, latest = self.policy.planner.zones, self.inputs.ultrasonic
        assert latest is not None
        for sonar, distance in enumerate(shown(latest.value)):
            approach = zones.approach(sonar, verdict.twist)
            assert approach <= zones.allowed(distance) + 1e-5
            if latest.age_s(self.now_ns) > 0.3:
                assert approach <= 1e-5

    def _inputs_are_good(self) -> bool:
        inputs = self.inputs
        for name, age_s in AGES_S.items():
            latest = getattr(inputs, name)
            if latest is None or latest.age_s(self.now_ns) > age_s:
                return False
        assert inputs.link
        assert inputs.switches
        switches = inputs.switches.value
        way = inputs.link.value
        on = switches.ultrasonic_brake is True and switches.bumper_brake is True
        return on and way.state == "up" and way.armed and inputs.measured is not None


def shown(sample: Ultrasonic) -> list[float]:
    """Return what the sonars show in this one sample; 0 where nothing can be trusted."""
    return [
        math.inf if status == "no_echo" else reading if status == "ok" and reading else 0.0
        for reading, status in zip(sample.ranges, sample.status, strict=True)
    ]


Act = Callable[[Watched], object]


def _set(**values: object) -> Act:
    def act(scene: Watched) -> None:
        for name, value in values.items():
            setattr(scene, name, value)

    return act


def _hostile(kind: str) -> Act:
    def act(scene: Watched) -> None:
        echo = scene.state.heartbeat.number
        good = Drive(linear=0.5, angular=0.0, echo=echo, seq=scene.driver_seq + 1, boot=99)
        bad = {
            "nan": Drive(linear=math.nan, angular=0.0, echo=echo, seq=scene.driver_seq + 1),
            "late": Drive(linear=0.5, angular=0.0, echo=echo - 200, seq=scene.driver_seq + 1),
            "again": Drive(linear=0.5, angular=0.0, echo=echo, seq=scene.driver_seq, boot=99),
            "rival": Drive(linear=0.5, angular=0.0, echo=echo, seq=1, boot=5),
        }
        scene.decide(Ask("nobody" if kind == "nobody" else "teleop", bad.get(kind, good)))

    return act


def _ask(linear: float, angular: float, source: str, ticks: int) -> Act:
    return lambda scene: scene.drive(linear, angular, ticks * 0.02, source)


def _range(name: str, distance: float | None) -> Act:
    return lambda scene: scene.sonar(**{name: distance})


speeds = st.sampled_from([0.0, 0.0, 0.3, 1.0, -0.5, 5.0])
acts = st.one_of(
    st.builds(_ask, speeds, speeds, st.sampled_from(["teleop", "nav"]), st.integers(1, 40)),
    st.builds(lambda n: lambda scene: scene.tick(n), st.integers(1, 40)),
    st.builds(_hostile, st.sampled_from(["nan", "late", "again", "rival", "nobody"])),
    st.builds(
        _range,
        st.sampled_from(["front", "front_left", "left", "rear", "rear_right"]),
        st.none() | st.floats(0.0, 3.0),
    ),
    st.sampled_from(
        [
            _set(pressed=True),
            _set(pressed=False),
            _set(left_bits=4),
            _set(left_bits=0),
            _set(reader=False),
            _set(reader=True),
            _set(muted={"bumper"}),
            _set(muted={"velocity", "ultrasonic"}),
            _set(muted={"link", "switches", "left", "right"}),
            _set(muted=set()),
            _set(link=link("lost")),
            _set(link=link(armed=False)),
            _set(link=link()),
            _set(switches=Switches(ultrasonic_brake=True, bumper_brake=False)),
            _set(switches=Switches(ultrasonic_brake=True, bumper_brake=True)),
            _set(linear=math.nan),
            _set(linear=0.0, angular=0.0),
            _set(linear=None, angular=None),
            _set(boot=8, seq=0),
            lambda scene: scene.estop(),
            lambda scene: scene.reset(),
            lambda scene: [(scene.hold(), scene.tick(3)) for _ in range(8)],
        ]
    ),
)


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.booleans(), st.lists(acts, max_size=20))
def test_whatever_happens(under_way: bool, sequence: list[Act]) -> None:
    scene = Watched()
    if under_way:
        scene.running()
    for act in sequence:
        act(scene)
    # The last invariant: when everything falls silent, the robot is told to stop, and it stays so.
    scene.inputs = replace(scene.inputs, event=None)
    scene.now_ns += round(0.31 * S)
    for _ in range(5):
        assert scene.decide().command != "run"
        scene.now_ns += S // 10


def test_the_oracle_sees_runs() -> None:
    scene = Watched()
    scene.running()
    assert scene.runs > 50
