"""The desk: presses in, requests and calls out, and the picture; on a bus that never opens."""

from collections.abc import Iterator
from typing import Any

import pytest

from common import keys
from common.bus.publisher import Publisher
from common.freshness import S
from common.messages import (
    Bumper,
    Done,
    Drive,
    Driver,
    Event,
    ReleaseRequest,
    ResetRequest,
    Velocity,
)
from common.requests import Twist
from services.teleop.desk import ESTOP_TICKS, Desk
from services.teleop.mapping import Deflection, Stick
from tests.teleop.support import FakeNode, link, safety_state

PERIOD_NS = S // 20


class FakeGamepad:
    """Pushed forward, with its deadman as told."""

    words = "Fake Pad"
    stick: Stick | None = None

    def read(self) -> Stick | None:
        return self.stick


class Operator:
    """A desk on a clock that only ticks move."""

    def __init__(self) -> None:
        self.node = FakeNode()
        self.desk = Desk(self.node, self.node.logbook)
        self.now_ns = 100 * S

    def press(self, key: str) -> None:
        self.desk.press(key, self.now_ns)

    def tell_safety(self, **fields: Any) -> None:
        self.node.fake.tell(keys.SAFETY, safety_state(**fields), self.now_ns)

    def ticks(self, count: int) -> list[Drive | None]:
        sent = []
        for _ in range(count):
            before, _ = self.node.requests
            self.desk.tick(self.now_ns)
            after, last = self.node.requests
            assert after - before <= 1
            sent.append(last if after > before else None)
            self.now_ns += PERIOD_NS
        return sent

    def speeds(self, count: int) -> list[float | None]:
        return [drive.linear if drive else None for drive in self.ticks(count)]

    @property
    def lines(self) -> list[str]:
        return [line.text for line in self.node.logbook.last(99)]


@pytest.fixture
def operator() -> Iterator[Operator]:
    operator = Operator()
    yield operator
    operator.node.loop.close()


def test_a_tap_is_asked_for_and_then_there_is_silence(operator: Operator) -> None:
    assert operator.speeds(3) == [None] * 3
    operator.press("w")
    assert operator.speeds(17) == [0.0] + [0.2] * 11 + [0.0] * 3 + [None] * 2


def test_requests_carry_the_echo(operator: Operator) -> None:
    operator.node.fake.tell(keys.SAFETY, safety_state(heartbeat=99))
    operator.press("w")
    (request,) = operator.ticks(1)
    assert request is not None
    assert request.echo == 99


def test_estop_lets_go_and_stops_the_robot(operator: Operator) -> None:
    operator.press("w")
    operator.ticks(3)
    operator.press("e")
    assert operator.node.fake.estops == 1
    assert operator.speeds(5) == [0.0] * 3 + [None] * 2
    assert operator.lines == ["emergency stop asked by the operator"]


def test_estop_is_repeated_until_safety_has_latched_it(operator: Operator) -> None:
    operator.press("e")
    operator.ticks(3)
    assert operator.node.fake.estops == 4
    operator.tell_safety(latched=("estop",))
    operator.ticks(3)
    assert operator.node.fake.estops == 4


def test_an_estop_that_nobody_confirms_is_said(operator: Operator) -> None:
    operator.press("e")
    operator.ticks(ESTOP_TICKS - 1)
    assert len(operator.lines) == 1
    operator.ticks(3)
    assert operator.node.fake.estops == ESTOP_TICKS + 1
    assert "NOT CONFIRMED" in operator.lines[-1]


def test_a_lost_bus_is_a_release_and_a_key_still_held_does_not_drive_on(
    operator: Operator,
) -> None:
    operator.tell_safety()
    speeds = []
    for _ in range(40):  # held all the time: two seconds, safety is heard no more
        operator.press("w")
        speeds += operator.speeds(1)
    assert speeds[1] == 0.2
    assert speeds[-5:] == [None] * 5
    assert "safety is not heard" in operator.lines[0]
    operator.tell_safety()
    for _ in range(20):
        operator.press("w")
        operator.tell_safety()
        assert operator.speeds(1) == [None]
    for _ in range(13):  # let go
        operator.tell_safety()
        operator.ticks(1)
    operator.press("w")
    operator.tell_safety()
    assert operator.speeds(2) == [0.0, 0.2]


def test_a_reset_is_asked_and_its_answer_shown(operator: Operator) -> None:
    operator.press("r")
    assert operator.node.fake.asked == [(keys.RESET.path, ResetRequest())]
    told, refused = operator.node.fake.answers[0]
    told(Done(text="cleared contact"))
    refused("the bumper is pressed")
    assert operator.lines == ["reset: cleared contact", "reset refused: the bumper is pressed"]


def test_a_release_is_asked_again_while_held_one_at_a_time(operator: Operator) -> None:
    fake = operator.node.fake
    operator.press("f")
    operator.ticks(3)
    assert fake.asked == [(keys.RELEASE.path, ReleaseRequest())]  # the first is not answered yet
    fake.answers[-1][0](Done(text="0.15 m left"))
    operator.ticks(1)
    fake.answers[-1][1]("safety does not answer")
    operator.ticks(1)
    fake.answers[-1][1]("safety does not answer")
    assert operator.desk.view.creeping is True
    assert [request.held for _, request in fake.asked] == [True] * 3
    operator.ticks(20)
    assert fake.asked[-1][1] == ReleaseRequest(held=False)
    creeping: bool = operator.desk.view.creeping
    assert creeping is False
    fake.answers[-1][0](Done(text="released"))
    count = len(fake.asked)
    operator.ticks(5)
    assert len(fake.asked) == count
    assert operator.lines == ["release: 0.15 m left", "release refused: safety does not answer"]


def test_creeping_sends_no_requests_to_move(operator: Operator) -> None:
    operator.press("f")
    assert operator.speeds(5) == [None] * 5


def test_a_gamepad_drives_while_the_screen_is_watched(operator: Operator) -> None:
    pad = FakeGamepad()
    operator.desk.plug(pad)
    operator.desk.watch(operator.now_ns)
    pad.stick = Stick(Deflection(1, 0), deadman=False, turbo=False)
    operator.ticks(1)
    pad.stick = Stick(Deflection(1, 0), deadman=True, turbo=False)
    sent = operator.speeds(24)
    assert sent[:19] == [0.0] + [0.2] * 18
    assert sent[20:] == [0.0, 0.0, 0.0, None]  # nobody looks any more


def test_a_gamepad_that_comes_is_told(operator: Operator) -> None:
    pad = FakeGamepad()
    operator.desk.plug(pad)
    operator.ticks(1)
    pad.read = lambda: setattr(pad, "words", "none")  # type: ignore[method-assign]
    operator.ticks(2)
    assert operator.lines == ["gamepad: none"]


def test_losing_the_focus_lets_go(operator: Operator) -> None:
    operator.press("w")
    operator.ticks(2)
    operator.desk.let_go()
    assert operator.speeds(4) == [0.0] * 3 + [None]


@pytest.mark.parametrize("driving", [True, False])
def test_leaving_sends_three_zeros_then_stops_the_loop(operator: Operator, driving: bool) -> None:
    if driving:
        operator.press("w")
        operator.ticks(3)
    operator.desk.leave()
    operator.desk.leave()  # once is enough
    operator.press("w")
    operator.press("e")
    assert operator.speeds(4) == [0.0] * 3 + [None]
    assert operator.node.fake.estops == 0
    operator.node.loop.run()  # returns, for it has been stopped


def test_the_picture_shows_what_is_fresh(operator: Operator) -> None:
    fake = operator.node.fake
    fake.tell(keys.SAFETY, safety_state(text="Driving."))
    fake.tell(keys.VELOCITY, Velocity(linear=0.2, angular=0.0))
    fake.tell(keys.BUMPER, Bumper(pressed=False))
    fake.tell(keys.LINK, link())
    fake.tell(keys.DRIVER, Driver(faults=("encoder",), bits=4), side="right")
    operator.desk.tick(0)  # a clock behind the messages': nothing is old
    view = operator.desk.view
    assert view.safety is not None
    assert view.safety.text == "Driving."
    assert view.velocity == Velocity(linear=0.2, angular=0.0)
    assert view.bumper == Bumper(pressed=False)
    assert view.link == link()
    assert (view.left, view.right) == (None, Driver(faults=("encoder",), bits=4))
    assert (view.connected, view.robot, view.top) == (False, "001", Twist(0.2, 0.3))
    operator.desk.tick(1 << 62)
    assert operator.desk.view.safety is None


def test_events_of_others_are_shown_and_our_own_not_twice(operator: Operator) -> None:
    fake = operator.node.fake
    everyone = keys.EVENTS.on("001", service="*")
    contact = Event(name="contact", level="error", text="the bumper was hit", boot=5, t_ns=7)
    mine = Event(name="estop", level="info", text="mine", boot=fake.boot)
    fake.tell(keys.EVENTS, contact, declared=everyone, service="safety")
    fake.tell(keys.EVENTS, mine, declared=everyone, service="teleop")
    (line,) = operator.node.logbook.last(9)
    assert (line.t_ns, line.service, line.level) == (7, "safety", "error")


def test_an_operator_who_may_not_drive_is_told_once(
    operator: Operator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Publisher, "passed_on", False)
    operator.tell_safety()
    operator.press("w")
    operator.ticks(15)
    assert [line for line in operator.lines if "NOT ALLOWED" in line] == [
        "NOT ALLOWED: the router drops our requests; this certificate may only watch"
    ]
