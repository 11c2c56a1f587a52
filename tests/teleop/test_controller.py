"""The controller: key presses in, requests and view out; on a bus that never opens."""

import pytest

from common import keys
from common.bus.publisher import Publisher
from common.messages import Bumper, Driver, Event, Velocity
from common.motion import Twist
from common.operator import ESTOP_TICKS, OVERRULED_TICKS
from services.teleop.controls import Deflection, Stick
from tests.factories import link, safety_state
from tests.teleop.support import FakeGamepad, Operator


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


def test_a_repeated_estop_is_sent_and_reported_once(operator: Operator) -> None:
    for _ in range(3):  # a held key repeats
        operator.press("e")
        operator.ticks(1)
    operator.tell_safety(latched=("estop",))
    operator.ticks(1)
    operator.press("e")
    operator.ticks(1)
    assert operator.node.fake.estops == 7
    assert operator.node.events == 1
    operator.tell_safety()  # reset
    operator.press("e")
    assert operator.node.events == 2


def test_an_unconfirmed_estop_is_reported(operator: Operator) -> None:
    operator.press("e")
    operator.ticks(ESTOP_TICKS - 1)
    assert len(operator.lines) == 1
    operator.ticks(3)
    assert operator.node.fake.estops == ESTOP_TICKS + 1
    assert "NOT CONFIRMED" in operator.lines[-1]


def test_an_estop_that_the_router_drops_is_reported(
    operator: Operator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Publisher, "passed_on", False)
    operator.press("e")
    for _ in range(ESTOP_TICKS + 2):
        operator.tell_safety()
        operator.ticks(1)
    assert operator.lines[-1] == (
        "EMERGENCY STOP NOT CONFIRMED, probably not allowed: use the vehicle's own switch"
    )
    assert operator.controller.view.alarm == operator.lines[-1]


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
    (line,) = operator.node.event_log.lines()
    assert (line.t_ns, line.service, line.level) == (7, "safety", "error")


def test_a_denied_operator_is_notified_once(
    operator: Operator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Publisher, "passed_on", False)
    for _ in range(15):
        operator.tell_safety()
        operator.ticks(1)
    assert [line for line in operator.lines if "NOT ALLOWED" in line] == [
        "NOT ALLOWED: the router drops our requests; this certificate may only watch"
    ]


def test_an_overruled_operator_has_to_release_the_controls(operator: Operator) -> None:
    def hold(ticks: int, source: str | None) -> list[float | None]:
        speeds: list[float | None] = []
        for _ in range(ticks):
            operator.tell_safety(source=source)
            operator.press("w")
            speeds += operator.speeds(1)
        return speeds

    operator.tell_safety(source="web")
    operator.ticks(1)
    assert operator.controller.view.alarm == ""
    assert hold(2 * OVERRULED_TICKS, "web")[-1] is None
    assert operator.controller.view.alarm == "OVERRULED by web: release the controls"
    assert set(hold(20, None)) == {None}
    assert operator.controller.view.alarm == "OVERRULED by web: release the controls"
    for _ in range(20):
        operator.tell_safety()
        operator.ticks(1)
    assert operator.controller.view.alarm == ""
    assert operator.lines == ["overruled by web: controls released"]
    assert hold(3, "teleop")[-1] == 0.2
