"""Supervision by the bridge while no safety commands: until standstill, and of it."""

from collections import Counter

import pytest

from common.freshness import NS_PER_S
from common.motion import BRAKE, STOP
from common.settings import Vehicle, Wire
from common.wire import framing
from common.wire.commands import MotionCommand, MotionKind
from services.bridge.config import BridgeConfig
from services.bridge.core.lease import Lease
from services.bridge.core.motion_output import MotionOutput
from services.bridge.core.output import Event, Send
from services.bridge.core.translate import Translator
from t2.messages import Command, Mileage, Motion, Velocity
from tests.bridge.core.core_fixture import BOOT, MS, NOW, SAFETY

CONFIG = BridgeConfig(vehicle=Vehicle(deceleration=0.6, angular_deceleration=2.0))
END = NOW + 200 * MS + 1  # of a lease from NOW on
UNCOMMANDED = Event("uncommanded_motion", "error")


class Output:
    """A motion output whose lease began at NOW."""

    def __init__(self) -> None:
        translator = Translator(Wire(), Vehicle())
        self.made = MotionOutput(CONFIG, translator, boot=BOOT, counters=Counter(), now_ns=NOW)
        self.seq = 0
        self.events: list[Event] = []
        self.renew(NOW)

    def renew(self, now_ns: int) -> None:
        """Begin a lease."""
        self.seq += 1
        motion = Motion(command=STOP, boot=SAFETY, seq=self.seq)
        list(self.made.on_motion(motion, now_ns, now_ns))

    def moves(self, linear: float, now_ns: int, angular: float = 0.0) -> None:
        self.made.on_velocity(Velocity(linear=linear, angular=angular), now_ns)

    def counts(self, distance: float, now_ns: int, epoch: int = 0) -> None:
        self.made.on_mileage(Mileage(distance=distance, heading=0.0, epoch=epoch), now_ns)

    def tick(self, now_ns: int) -> list[Command]:
        """Return the orders of a tick."""
        outputs = list(self.made.on_tick(now_ns))
        self.events += [one for one in outputs if isinstance(one, Event)]
        return [one.order for one in outputs if isinstance(one, Send) and one.order]


@pytest.fixture
def output() -> Output:
    return Output()


@pytest.fixture
def stood(output: Output) -> Output:
    """Return an output whose lease is over, and whose vehicle has stood since then."""
    output.moves(0.0, NOW)
    assert output.tick(END) == [STOP]
    output.moves(0.0, END)
    return output


@pytest.mark.parametrize(
    ("linear", "angular", "age", "limit_s"),
    [
        (0.12, 0.0, 0, 0.7),
        (-0.12, 0.0, 200 * MS, 0.7),
        (0.0, -0.2, 0, 0.6),
        (0.12, 0.6, 0, 0.8),
        (0.8, 0.0, 0, 1.0),  # the coast limit is sooner
        (0.12, 0.0, 200 * MS + 1, 1.0),  # too old
    ],
)
def test_it_must_stand_by_then(
    output: Output, linear: float, angular: float, age: int, limit_s: float
) -> None:
    output.moves(linear, END - age, angular)
    assert output.tick(END) == [STOP]
    due_ns = END + round(limit_s * NS_PER_S)
    for now_ns, order in ((due_ns - 40 * MS, STOP), (due_ns, STOP), (due_ns + 40 * MS, BRAKE)):
        output.moves(linear, now_ns, angular)
        assert output.tick(now_ns) == [order]
    output.moves(0.0, due_ns + 80 * MS)
    assert output.tick(due_ns + 80 * MS) == [STOP]
    assert output.events == []


def test_without_a_velocity_it_is_taken_to_stand(output: Output) -> None:
    for after_s in (0, 2, 4):
        assert output.tick(END + after_s * NS_PER_S) == [STOP]


@pytest.mark.parametrize("order", [STOP, BRAKE])
def test_an_order_without_numbers_ignores_those_of_its_motion(
    output: Output, order: Command
) -> None:
    kind = MotionKind.STOP if order is STOP else MotionKind.BREAK
    sent = output.made.order(order, Motion(command=order, linear=1.0, angular=1.0))
    assert sent == Send(framing.pack(MotionCommand(kind, 0, 0)), 0, order)


def test_a_hit_brakes_once_for_its_datagram(output: Output) -> None:
    assert output.made.reflex(NOW)[0].order is BRAKE
    for braked in ([], [BRAKE], [BRAKE]):
        outputs = list(output.made.on_hit(1, NOW))
        assert [one.order for one in outputs if isinstance(one, Send)] == braked


def test_a_hit_counts_for_the_period_of_stop(output: Output) -> None:
    list(output.made.on_hit(1, NOW + 9 * MS))
    assert output.tick(NOW + 39 * MS - 1) == []
    assert output.tick(NOW + 39 * MS) == [BRAKE]


@pytest.mark.parametrize("order", [STOP, BRAKE])
def test_standstill_must_be_measured_after_the_stop(output: Output, order: Command) -> None:
    output.moves(0.0, NOW)
    list(output.made.stop(NOW))
    output.moves(0.0, NOW + (order is STOP))
    assert output.made.on_exit(NOW + 1).order is order


def test_before_the_first_lease_the_coast_limit_counts() -> None:
    made = Output()
    made.made.lease = Lease(over_since_ns=NOW, boot=SAFETY)
    made.moves(0.5, NOW)
    assert made.tick(NOW + 40 * MS) == [STOP]
    made.moves(0.5, NOW + NS_PER_S)
    assert made.tick(NOW + NS_PER_S) == [STOP]
    assert made.tick(NOW + NS_PER_S + 40 * MS) == [BRAKE]


def test_while_the_lease_is_valid_safety_supervises_it(stood: Output) -> None:
    stood.counts(0.0, END)
    stood.renew(END)
    stood.tick(END + MS)
    stood.moves(0.0, END + MS)
    stood.counts(9.0, END + MS)
    stood.tick(END + 2 * MS)
    over = END + 201 * MS
    stood.tick(over)
    stood.moves(0.0, over)
    stood.counts(11.0, over)
    stood.counts(11.04, over + MS)
    stood.tick(over + 40 * MS)
    assert stood.events == []
    stood.counts(11.06, over + 40 * MS)
    stood.tick(over + 80 * MS)
    assert stood.events == [UNCOMMANDED]
