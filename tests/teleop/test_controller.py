"""The controller: key presses in, requests, calls and view out; on a bus that never opens."""

from collections.abc import Iterator
from typing import Any

import pytest
from msgspec import structs

from common import keys
from common.bus.publisher import Publisher
from common.freshness import NS_PER_S
from common.messages import (
    Bumper,
    Direction,
    Done,
    Drive,
    Driver,
    Event,
    ReleaseRequest,
    ResetDone,
    ResetRequest,
    SafetyState,
    Velocity,
)
from common.motion import Twist
from common.operator import ESTOP_TICKS
from services.teleop.controller import Controller
from services.teleop.controls import Deflection, Stick
from services.teleop.hold import Press
from tests.factories import contact_state, link, safety_state
from tests.teleop.support import FakeNode, answer

PERIOD_NS = NS_PER_S // 20


class FakeGamepad:
    """A gamepad with a configured state."""

    status = "Fake Pad"
    stick: Stick | None = None

    def read(self) -> Stick | None:
        return self.stick


class Operator:
    """A controller with a simulated clock that advances by ticks."""

    def __init__(self) -> None:
        self.node = FakeNode()
        self.controller = Controller(self.node, self.node.event_log)
        self.now_ns = 100 * NS_PER_S
        self.near = True  # the terminal answers at once
        self.shown: SafetyState | None = None
        answer(self.controller, self.now_ns)

    def press(self, key: str, waited_s: float = 0.0) -> None:
        at_ns = self.now_ns - round(waited_s * NS_PER_S)
        self.controller.press(Press(key, at_ns, self.shown), self.now_ns)

    def wait(self, seconds: float) -> None:
        """Advance the clock without ticks; then the terminal answers at once."""
        self.now_ns += round(seconds * NS_PER_S)
        answer(self.controller, self.now_ns)

    def tell_safety(self, **fields: Any) -> None:
        self.node.fake.deliver(keys.SAFETY, safety_state(**fields), self.now_ns)

    def tell_contact(self, **fields: Any) -> None:
        """Simulate a pressed bumper in safety's state and on the screen."""
        self.shown = contact_state(**{"boot": 5} | fields)
        self.node.fake.deliver(keys.SAFETY, self.shown, self.now_ns)

    def ticks(self, count: int) -> list[Drive | None]:
        sent = []
        for _ in range(count):
            before, _ = self.node.requests
            self.controller.tick(self.now_ns)
            after, last = self.node.requests
            assert after - before <= 1
            sent.append(last if after > before else None)
            self.now_ns += PERIOD_NS
            if self.near:
                answer(self.controller, self.now_ns)
        return sent

    def speeds(self, count: int) -> list[float | None]:
        return [drive.linear if drive else None for drive in self.ticks(count)]

    @property
    def lines(self) -> list[str]:
        return [line.text for line in self.node.event_log.last(99)]


@pytest.fixture
def operator() -> Iterator[Operator]:
    operator = Operator()
    yield operator
    operator.node.loop.close()


def test_a_tap_sends_requests_and_then_nothing(operator: Operator) -> None:
    assert operator.speeds(3) == [None] * 3
    operator.press("w")
    assert operator.speeds(17) == [0.0] + [0.2] * 11 + [0.0] * 3 + [None] * 2


def test_requests_carry_the_echo(operator: Operator) -> None:
    operator.node.fake.deliver(keys.SAFETY, safety_state(heartbeat=99))
    operator.press("w")
    (request,) = operator.ticks(1)
    assert request is not None
    assert request.echo == 99


def test_estop_releases_and_stops_the_robot(operator: Operator) -> None:
    operator.press("w")
    operator.ticks(3)
    operator.press("e")
    assert operator.node.fake.estops == 1
    assert operator.speeds(5) == [0.0] * 3 + [None] * 2
    assert operator.lines == ["emergency stop requested by the operator"]


def test_estop_is_repeated_until_safety_has_latched_it(operator: Operator) -> None:
    operator.press("e")
    operator.ticks(3)
    assert operator.node.fake.estops == 4
    operator.tell_safety(latched=("estop",))
    operator.ticks(3)
    assert operator.node.fake.estops == 4


def test_an_unconfirmed_estop_is_reported(operator: Operator) -> None:
    operator.press("e")
    operator.ticks(ESTOP_TICKS - 1)
    assert len(operator.lines) == 1
    operator.ticks(3)
    assert operator.node.fake.estops == ESTOP_TICKS + 1
    assert "NOT CONFIRMED" in operator.lines[-1]


def test_a_lost_bus_releases_and_a_held_key_does_not_drive_again(
    operator: Operator,
) -> None:
    operator.tell_safety()
    speeds = []
    for _ in range(40):  # held for two seconds, without a state of safety
        operator.press("w")
        speeds += operator.speeds(1)
    assert speeds[1] == 0.2
    assert speeds[-5:] == [None] * 5
    assert "no state of safety" in operator.lines[0]
    operator.tell_safety()
    for _ in range(20):
        operator.press("w")
        operator.tell_safety()
        assert operator.speeds(1) == [None]
    for _ in range(13):  # released
        operator.tell_safety()
        operator.ticks(1)
    operator.press("w")
    operator.tell_safety()
    assert operator.speeds(2) == [0.0, 0.2]


DONE = ResetDone(text="cleared contact", boot=5, heartbeat=8, cleared=(42,))


def test_a_reset_clears_the_shown_causes_and_is_confirmed(operator: Operator) -> None:
    operator.tell_contact()
    operator.press("r")
    request = ResetRequest(echo=7, causes=(42,))
    assert operator.node.fake.asked == [(keys.RESET.path, request)]
    operator.node.fake.answers[0][0](DONE)
    operator.ticks(1)
    for _ in range(60):
        operator.tell_safety(boot=5, heartbeat=8)
        operator.ticks(1)
    assert operator.lines == ["reset: cleared contact"]


def test_a_reset_without_effect_is_not_confirmed(operator: Operator) -> None:
    operator.tell_contact()
    operator.press("r")
    operator.node.fake.answers[0][0](DONE)
    for _ in range(20):  # the latch stays
        operator.tell_contact(heartbeat=8)
        operator.ticks(1)
    assert operator.lines == ["reset: cleared contact"]
    assert_unconfirmed(operator)


def test_a_reset_that_another_program_answers_is_not_confirmed(operator: Operator) -> None:
    operator.tell_contact()
    operator.press("r")
    operator.node.fake.answers[0][0](structs.replace(DONE, boot=77))
    for _ in range(20):
        operator.tell_safety(boot=5, heartbeat=8)
        operator.ticks(1)
    assert_unconfirmed(operator)


def assert_unconfirmed(operator: Operator) -> None:
    operator.ticks(3)
    (line,) = (line for line in operator.node.event_log.last(99) if "NOT CONFIRMED" in line.text)
    assert line.level == "error"


def test_a_refused_reset_is_reported_and_the_next_one_is_sent(operator: Operator) -> None:
    operator.tell_contact()
    operator.press("r")
    operator.press("r")  # the key repeats
    assert len(operator.node.fake.asked) == 1
    operator.node.fake.answers[0][1]("The call is 5.0 s old, allowed is 0.4 s: repeat it.")
    operator.ticks(5)
    assert operator.lines == ["reset refused: The call is 5.0 s old, allowed is 0.4 s: repeat it."]
    operator.tell_contact()
    operator.press("r")
    assert len(operator.node.fake.asked) == 2


def test_a_new_reset_replaces_one_that_waits_for_its_state(operator: Operator) -> None:
    operator.tell_contact()
    operator.press("r")
    operator.node.fake.answers[0][0](DONE)
    operator.press("r")
    assert len(operator.node.fake.asked) == 2
    operator.node.fake.answers[0][1]("late")  # of the first one
    operator.press("r")
    assert len(operator.node.fake.asked) == 2


@pytest.mark.parametrize("shown", [True, False])
def test_a_reset_is_not_sent_without_a_fresh_state(operator: Operator, shown: bool) -> None:
    operator.tell_contact()
    if not shown:
        operator.shown = None
    else:
        operator.wait(0.6)
    operator.press("r")
    assert operator.node.fake.asked == []
    assert operator.lines == ["reset not sent: no fresh state of safety"]


@pytest.mark.parametrize(("key", "direction"), [("f", "forward"), ("b", "backward")])
def test_a_release_is_repeated_while_held_one_at_a_time(
    operator: Operator, key: str, direction: Direction
) -> None:
    fake = operator.node.fake
    operator.tell_contact()
    operator.press(key)
    operator.ticks(3)
    held = ReleaseRequest(direction=direction, echo=7)
    assert fake.asked == [(keys.RELEASE.path, held)]  # the first is not answered yet
    fake.answers[-1][0](Done(text="0.15 m left"))
    operator.tell_contact(heartbeat=8)
    operator.ticks(1)
    fake.answers[-1][0](Done(text="0.14 m left"))
    operator.ticks(1)
    fake.answers[-1][1]("safety does not answer")
    operator.ticks(1)
    fake.answers[-1][1]("safety does not answer")
    assert operator.controller.view.release == direction
    assert [request.echo for _, request in fake.asked] == [7, 8, 8, 8]
    for _ in range(20):
        operator.tell_contact(heartbeat=9)
        operator.ticks(1)
    assert fake.asked[-1][1] == ReleaseRequest(held=False, echo=9)
    released: Direction | None = operator.controller.view.release
    assert released is None
    fake.answers[-1][0](Done(text="released"))
    count = len(fake.asked)
    operator.ticks(5)
    assert len(fake.asked) == count
    assert operator.lines == ["release: 0.15 m left", "release refused: safety does not answer"]


def test_a_release_is_not_sent_without_a_fresh_state(operator: Operator) -> None:
    operator.press("b")
    operator.ticks(5)
    assert operator.node.fake.asked == []
    assert operator.lines == ["release not sent: no fresh state of safety"]
    operator.ticks(20)
    (request,) = operator.node.fake.asked  # an end is sent in any case
    assert request[1] == ReleaseRequest(held=False)


def test_a_release_in_the_other_direction_ends_the_first_one(operator: Operator) -> None:
    fake = operator.node.fake
    operator.tell_contact(heartbeat=7)
    operator.press("f")
    operator.ticks(1)
    fake.answers[-1][0](Done(text="0.15 m left"))
    operator.press("b")
    operator.ticks(3)  # safety takes no hold that echoes the end: wait for its next state
    operator.tell_contact(heartbeat=8)
    operator.ticks(2)
    assert [request for _, request in fake.asked] == [
        ReleaseRequest(direction="forward", echo=7),
        ReleaseRequest(held=False, echo=7),
        ReleaseRequest(direction="backward", echo=8),
    ]


def test_the_answer_to_an_end_does_not_complete_a_hold(operator: Operator) -> None:
    fake = operator.node.fake
    operator.tell_contact(heartbeat=7)
    operator.press("f")
    operator.ticks(1)
    operator.press("b")
    operator.tell_contact(heartbeat=8)
    operator.ticks(1)
    fake.answers[1][0](Done(text="Let go."))
    fake.answers[1][1]("late")
    operator.tell_contact(heartbeat=9)
    operator.ticks(1)
    assert len(fake.asked) == 2  # the first hold is not answered yet
    fake.answers[0][1]("safety does not answer")
    operator.ticks(1)
    assert fake.asked[-1][1] == ReleaseRequest(direction="backward", echo=9)


def test_a_release_sends_no_requests_to_move(operator: Operator) -> None:
    operator.press("f")
    assert operator.speeds(5) == [None] * 5


@pytest.mark.parametrize("key", ["w", "r", "f", "b", "t", "5"])
def test_a_press_that_waited_for_long_does_nothing(operator: Operator, key: str) -> None:
    operator.tell_contact()
    for _ in range(5):
        operator.press(key, waited_s=0.51)
    assert operator.speeds(3) == [None] * 3
    assert operator.node.fake.asked == []
    assert (operator.controller.view.gear, operator.controller.view.turbo) == (1, False)
    assert operator.lines == [f"key {key.upper()} ignored: it is 0.5 s old"]
    operator.wait(1.5)
    operator.press(key, waited_s=3.0)
    assert operator.lines[1:] == [f"key {key.upper()} ignored: it is 3.0 s old"]


def test_an_estop_and_a_stop_count_at_any_age(operator: Operator) -> None:
    operator.press("e", waited_s=60.0)
    assert operator.node.fake.estops == 1
    operator.ticks(5)
    operator.press("space", waited_s=60.0)
    assert operator.speeds(4) == [0.0] * 3 + [None]


def test_a_recent_press_counts_from_its_receive_time(operator: Operator) -> None:
    operator.ticks(10)
    operator.press("w", waited_s=0.3)
    assert [speed for speed in operator.speeds(10) if speed] == [0.2] * 5


def slow(operator: Operator, took_s: float = 0.42) -> None:
    """Simulate a terminal that answers late from now on."""
    operator.near = False
    operator.controller.terminal.sent(1, operator.now_ns - round(took_s * NS_PER_S))
    operator.controller.terminal.answered(1, operator.now_ns)


@pytest.mark.parametrize("key", ["w", "left", "f", "b", "r"])
def test_on_a_slow_terminal_keys_move_and_reset_nothing(operator: Operator, key: str) -> None:
    operator.tell_contact()
    slow(operator)
    for _ in range(3):
        operator.press(key)
        assert operator.speeds(1) == [None]
    assert operator.node.fake.asked == []
    assert operator.lines == [
        "keys ignored: terminal too slow: 0.42 s, allowed 0.15 s; "
        "use `t2 drive` on a machine near the robot, or the dashboard"
    ]
    assert operator.controller.view.keys_refused == "terminal too slow: 0.42 s, allowed 0.15 s"


def test_on_a_slow_terminal_a_stop_counts(operator: Operator) -> None:
    slow(operator)
    operator.press("e")
    assert operator.node.fake.estops == 1
    assert operator.speeds(4) == [0.0] * 3 + [None]
    operator.press("space")
    assert operator.speeds(4) == [0.0] * 3 + [None]


def test_a_terminal_that_becomes_slow_releases_its_keys(operator: Operator) -> None:
    operator.press("w")
    assert operator.speeds(2) == [0.0, 0.2]
    slow(operator)
    assert operator.speeds(5) == [0.0] * 3 + [None] * 2
    operator.near = True
    for _ in range(40):  # what is still held when it is fast again does not drive
        operator.press("w")
        assert operator.speeds(1) == [None]
    operator.ticks(20)
    operator.press("w")
    assert operator.speeds(2) == [0.0, 0.2]
    assert len([line for line in operator.lines if "keys ignored" in line]) == 1


def test_a_terminal_that_stops_answering_releases_its_keys(operator: Operator) -> None:
    operator.near = False
    speeds = []
    for _ in range(20):
        operator.press("w")
        speeds += operator.speeds(1)
    assert speeds[1] == 0.2
    assert speeds[-5:] == [None] * 5


def test_a_multiplexer_over_ssh_does_not_drive() -> None:
    node = FakeNode()
    controller = Controller(node, node.event_log, "tmux over ssh hides the terminal's delay")
    answer(controller, NS_PER_S)
    controller.press(Press("w", NS_PER_S), NS_PER_S)
    controller.tick(NS_PER_S)
    assert node.requests == (0, None)
    node.loop.close()


def test_a_gamepad_drives_while_the_screen_is_redrawn(operator: Operator) -> None:
    pad = FakeGamepad()
    operator.controller.use_gamepad(pad)
    operator.controller.screen_drawn(operator.now_ns)
    pad.stick = Stick(Deflection(1, 0), deadman=False, turbo=False)
    operator.ticks(1)
    pad.stick = Stick(Deflection(1, 0), deadman=True, turbo=False)
    sent = operator.speeds(24)
    assert sent[:19] == [0.0] + [0.2] * 18
    assert sent[20:] == [0.0, 0.0, 0.0, None]  # the screen is not redrawn any more


def test_a_gamepad_that_freezes_is_released_and_reported(operator: Operator) -> None:
    pad = FakeGamepad()
    operator.controller.use_gamepad(pad)
    pad.stick = Stick(Deflection(1, 0), deadman=False, turbo=False)
    speeds: list[float | None] = []
    hinted = 0
    for tick in range(70):
        operator.controller.screen_drawn(operator.now_ns)
        speeds += operator.speeds(1)
        hinted += operator.controller.view.move_stick
        pad.stick = Stick(Deflection(1, 0), deadman=True, turbo=False, events=min(tick, 10))
    assert speeds.count(0.2) == 10 + 40
    assert speeds[-10:] == [None] * 10
    assert hinted == 20
    assert [line for line in operator.lines if "gamepad released" in line] == [
        "gamepad released: deflected, and no event for 2 s; release the deadman, "
        "then press it again"
    ]


def test_a_gamepad_change_is_reported(operator: Operator) -> None:
    pad = FakeGamepad()
    operator.controller.use_gamepad(pad)
    operator.ticks(1)
    pad.read = lambda: setattr(pad, "status", "none")  # type: ignore[method-assign]
    operator.ticks(2)
    assert operator.lines == ["gamepad: none"]


def test_losing_the_focus_releases(operator: Operator) -> None:
    operator.press("w")
    operator.ticks(2)
    operator.controller.release_controls()
    assert operator.speeds(4) == [0.0] * 3 + [None]


@pytest.mark.parametrize("driving", [True, False])
def test_quitting_sends_three_zeros_then_stops_the_loop(operator: Operator, driving: bool) -> None:
    if driving:
        operator.press("w")
        operator.ticks(3)
    operator.controller.leave()
    operator.controller.leave()  # once is enough
    operator.press("w")
    operator.press("e")
    assert operator.speeds(4) == [0.0] * 3 + [None]
    assert operator.node.fake.estops == 0
    operator.node.loop.run()  # returns, for it has been stopped


def test_the_view_shows_fresh_values(operator: Operator) -> None:
    fake = operator.node.fake
    fake.deliver(keys.SAFETY, safety_state(text="Driving."))
    fake.deliver(keys.VELOCITY, Velocity(linear=0.2, angular=0.0))
    fake.deliver(keys.BUMPER, Bumper(pressed=False))
    fake.deliver(keys.LINK, link())
    fake.deliver(keys.DRIVER, Driver(faults=("encoder",), bits=4), side="right")
    operator.controller.tick(0)  # a clock behind the messages': nothing is old
    view = operator.controller.view
    assert view.safety is not None
    assert view.safety.text == "Driving."
    assert view.velocity == Velocity(linear=0.2, angular=0.0)
    assert view.bumper == Bumper(pressed=False)
    assert view.link == link()
    assert (view.left, view.right) == (None, Driver(faults=("encoder",), bits=4))
    assert (view.connected, view.robot, view.top) == (False, "001", Twist(0.2, 0.3))
    operator.controller.tick(1 << 62)
    assert operator.controller.view.safety is None


def test_events_of_others_are_shown_and_own_ones_only_once(operator: Operator) -> None:
    fake = operator.node.fake
    everyone = keys.EVENTS.on("001", service="*")
    contact = Event(name="contact", level="error", text="the bumper was hit", boot=5, t_ns=7)
    mine = Event(name="estop", level="info", text="mine", boot=fake.boot)
    fake.deliver(keys.EVENTS, contact, declared=everyone, service="safety")
    fake.deliver(keys.EVENTS, mine, declared=everyone, service="teleop")
    (line,) = operator.node.event_log.last(9)
    assert (line.t_ns, line.service, line.level) == (7, "safety", "error")


def test_a_denied_operator_is_notified_once(
    operator: Operator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Publisher, "passed_on", False)
    operator.tell_safety()
    operator.press("w")
    operator.ticks(15)
    assert [line for line in operator.lines if "NOT ALLOWED" in line] == [
        "NOT ALLOWED: the router drops our requests; this certificate may only watch"
    ]
