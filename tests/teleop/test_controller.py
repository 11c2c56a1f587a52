"""The controller: key presses in, requests and view out; on a bus that never opens."""

import pytest
from msgspec import structs

from common.bus.bus import no_answer, not_allowed
from common.bus.publisher import Publisher
from t2 import keys
from t2.client import DENIED_AFTER, ESTOP_TICKS, KEPT_TICKS, OVERRULED_TICKS
from t2.messages import Driver, Event, Phrase, Refusal, ResetDone, ResetRequest
from tests.factories import link, safety_state
from tests.fake_bus import FakeBus
from tests.teleop.inputs import answer, stick
from tests.teleop.support import FakeGamepad, Operator, english

DONE = ResetDone(text="Reset.", boot=5, heartbeat=8, cleared=(42,))


# --- requests -------------------------------------------------------------------------------


@pytest.mark.parametrize(("key", "release"), [("w", "none"), ("f", "forward"), ("b", "backward")])
def test_requests_carry_echo_and_release(operator: Operator, key: str, release: str) -> None:
    operator.node.fake.deliver(keys.SAFETY, safety_state(heartbeat=99))
    operator.press(key)
    request = operator.ticks(2)[-1]
    assert request is not None
    assert (request.echo, request.release) == (99, release)
    assert (request.linear > 0) is (key == "w")


@pytest.mark.parametrize("driving", [True, False])
def test_quitting_sends_three_zeros_then_stops_the_loop(operator: Operator, driving: bool) -> None:
    if driving:
        operator.press("w")
        operator.ticks(3)
    operator.controller.leave()
    operator.controller.leave()  # once is enough
    operator.press("w")
    assert operator.speeds(4) == [0.0] * 3 + [None]
    operator.node.loop.run()  # returns, for it has been stopped


@pytest.mark.parametrize("order", ["eq", "qe"])
def test_quitting_waits_for_an_emergency_stop(operator: Operator, order: str) -> None:
    operator.tell_safety()
    for key in order:
        operator.press("e") if key == "e" else operator.controller.leave()
    operator.ticks(10)
    assert operator.node.fake.estops == 11
    operator.tell_safety(latched=("estop",))
    operator.ticks(2)
    assert (operator.node.fake.estops, operator.unconfirmed) == (11, "")
    operator.node.loop.run()  # returns, for it has been stopped


# --- emergency stop -------------------------------------------------------------------------


def test_estop_is_repeated_until_safety_has_latched_it(operator: Operator) -> None:
    operator.tell_safety()
    operator.press("e")
    operator.ticks(3)
    assert operator.node.fake.estops == 4
    operator.tell_safety(latched=("estop",))
    operator.ticks(3)
    assert operator.node.fake.estops == 4


def test_a_repeated_estop_is_sent_and_reported_once(operator: Operator) -> None:
    operator.tell_safety()
    for _ in range(3):  # a held key repeats
        operator.press("e")
        operator.ticks(1)
    operator.tell_safety(latched=("estop",))
    operator.ticks(1)
    operator.press("e")
    operator.ticks(KEPT_TICKS)
    assert operator.node.fake.estops == 7 + KEPT_TICKS - 1  # the latch may be the earlier one
    assert operator.node.events == ["estop"]
    operator.tell_safety()  # reset
    operator.press("e")
    assert operator.node.events == ["estop"] * 2


@pytest.mark.parametrize("denied", [True, False])
def test_an_estop_that_is_not_latched_is_reported(
    operator: Operator, monkeypatch: pytest.MonkeyPatch, denied: bool
) -> None:
    monkeypatch.setattr(Publisher, "passed_on", not denied)
    monkeypatch.setattr(FakeBus, "connected", True)
    operator.press("e")
    for ticks in (ESTOP_TICKS - 1, 3):
        assert not any("NOT CONFIRMED" in line for line in operator.lines)
        for _ in range(ticks):
            operator.tell_safety()
            operator.ticks(1)
    assert operator.node.fake.estops == ESTOP_TICKS + 3  # and so on
    why = ", probably not allowed" if denied else ""
    alarm = f"EMERGENCY STOP NOT CONFIRMED{why}: use the vehicle's own switch."
    assert operator.lines[-1] == alarm
    assert operator.alarm == f"{alarm} It is repeated for 27 s."
    operator.tell_safety(latched=("estop",))
    operator.ticks(1)
    assert not operator.alarm.startswith(alarm)


NOT_SENT = "EMERGENCY STOP NOT SENT YET: no connection. Use the vehicle's own switch. "
LAPSED = "YOUR E-STOP WAS NOT SENT: press E again; use the vehicle's own switch."


def test_an_estop_without_a_router_is_sent_once_it_is_back(
    operator: Operator, monkeypatch: pytest.MonkeyPatch
) -> None:
    operator.press("e")
    operator.ticks(1)
    alarm = f"{NOT_SENT}It is sent if the connection returns within 30 s."
    assert operator.alarm == alarm
    operator.ticks(580)
    assert operator.alarm == alarm.replace("30", "1")
    monkeypatch.setattr(FakeBus, "connected", True)
    before = operator.node.fake.estops
    operator.tell_safety()
    operator.ticks(1)
    assert operator.node.fake.estops == before + 1
    operator.tell_safety(latched=("estop",))
    operator.ticks(1)
    assert operator.unconfirmed == ""


@pytest.mark.parametrize("suspended", [True, False])
def test_an_estop_that_was_not_sent_is_shown_until_it_is_acknowledged(
    operator: Operator, monkeypatch: pytest.MonkeyPatch, suspended: bool
) -> None:
    operator.press("e")
    if suspended:
        operator.wait(31)
    else:
        operator.ticks(601)
    monkeypatch.setattr(FakeBus, "connected", True)
    operator.node.fake.estops = 0
    for latched in ((), ("estop",), ()):  # of somebody else
        operator.tell_safety(latched=latched)
        operator.press("space")
        operator.ticks(2)
        assert operator.alarm == f"{LAPSED} Enter: understood"
    assert operator.unconfirmed == LAPSED
    assert operator.node.fake.estops == 0
    operator.press("enter")
    operator.node.fake.deliver(keys.LINK, link(), operator.now_ns)
    operator.ticks(1)
    assert operator.alarm == ""


def test_an_estop_that_nobody_confirms_is_shown_until_the_next_one(
    operator: Operator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FakeBus, "connected", True)  # a router without this robot's safety
    operator.press("e")
    operator.ticks(602)
    lapsed = LAPSED.replace("WAS NOT SENT", "IS NOT CONFIRMED")
    assert operator.alarm == f"{lapsed} Enter: understood"
    operator.press("e")
    operator.tell_safety(latched=("estop",))
    operator.node.fake.deliver(keys.LINK, link(), operator.now_ns)
    operator.ticks(1)
    assert operator.alarm == ""


def test_without_board_the_vehicle_may_still_move(
    operator: Operator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FakeBus, "connected", True)
    for state, alarm in (("lost", "The vehicle may still move: use its own switch."), ("up", "")):
        operator.tell_safety()
        operator.node.fake.deliver(keys.LINK, link(state=state), operator.now_ns)
        operator.ticks(1)
        assert operator.alarm == alarm


# --- rules ----------------------------------------------------------------------------------


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
    assert operator.lines[0].startswith("No state of safety for 1 s")
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


def test_a_suspended_program_releases_what_it_finds_held(operator: Operator) -> None:
    pad = FakeGamepad()
    operator.controller.use_gamepad(pad)

    def drive(deadman: bool = True) -> float | None:
        operator.tell_safety()
        operator.controller.screen_drawn(operator.now_ns)
        pad.stick = stick(deadman=deadman, events=operator.now_ns)
        return operator.speeds(1)[0]

    assert [drive(deadman) for deadman in (False, True, True)] == [None, 0.0, 0.2]
    operator.wait(0.6)
    operator.press("w")  # the terminal kept its repeats
    assert [drive() for _ in range(5)] == [0.0, 0.0, 0.0, None, None]
    assert [drive(deadman) for deadman in (False, True, True)] == [None, 0.0, 0.2]


def test_a_terminal_that_answers_no_more_releases_the_gamepad(operator: Operator) -> None:
    pad = FakeGamepad()
    operator.controller.use_gamepad(pad)

    def drive(deadman: bool = True) -> float | None:
        operator.controller.screen_drawn(operator.now_ns)  # it is drawn, but not shown
        pad.stick = stick(deadman=deadman, events=operator.now_ns)
        return operator.speeds(1)[0]

    assert [drive(deadman) for deadman in (False, True, True)] == [None, 0.0, 0.2]
    operator.near = False
    assert [drive() for _ in range(25)][20:] == [0.2, 0.0, 0.0, 0.0, None]
    operator.near = True
    operator.wait(0.1)
    assert [drive(deadman) for deadman in (True, False, True, True)] == [None, None, 0.0, 0.2]


def test_a_gamepad_drives_while_the_screen_is_redrawn(operator: Operator) -> None:
    pad = FakeGamepad()
    operator.controller.use_gamepad(pad)
    operator.controller.screen_drawn(operator.now_ns)
    pad.stick = stick(deadman=False)
    operator.ticks(1)
    pad.stick = stick()
    sent = operator.speeds(24)
    assert sent[:19] == [0.0] + [0.2] * 18
    assert sent[20:] == [0.0, 0.0, 0.0, None]  # the screen is not redrawn any more


def test_the_screen_and_the_events_name_what_a_gamepad_lacks(operator: Operator) -> None:
    pad = FakeGamepad()
    operator.controller.use_gamepad(pad)

    def notices(count: int, events: int) -> list[str]:
        found = []
        for _ in range(count):
            operator.controller.screen_drawn(operator.now_ns)
            pad.stick = stick(deadman=events > 0, events=events)
            operator.ticks(1)
            found.append(english(operator.controller.view.gamepad_notice))
        return found

    notices(1, 0)
    due, frozen = "no change: MOVE THE STICK", "FROZEN: let go of the deadman"
    assert notices(60, 1) == [""] * 21 + [due] * 20 + [frozen] * 19
    assert notices(1, 0) == [""]
    for _ in range(2):
        pad.ignored = {3: -1.0}
        assert notices(3, 2) == ["OFF CENTRE, ignored: axis 3"] * 3
        pad.ignored = {}
        notices(1, 0)
    off_centre = "Gamepad: axis 3 is at -1.00 as the deadman goes down: ignored. "
    assert [line.startswith(off_centre) for line in operator.lines] == [False, True]


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
    assert operator.alarm == ""
    assert hold(2 * OVERRULED_TICKS, "web")[-1] is None
    assert operator.alarm == "OVERRULED by web (page): let go of the controls."
    assert set(hold(20, None)) == {None}
    assert operator.alarm == "OVERRULED by web (page): let go of the controls."
    for _ in range(20):
        operator.tell_safety()
        operator.ticks(1)
    assert operator.alarm == ""
    assert operator.node.events == ["take_over", "overruled"]
    assert hold(3, "teleop")[-1] == 0.2


@pytest.mark.parametrize("key", ["w", "r", "f", "b", "5"])
def test_a_press_that_waited_for_long_does_nothing(operator: Operator, key: str) -> None:
    operator.tell_contact()
    for _ in range(5):
        operator.press(key, waited_s=0.51)
    assert operator.speeds(3) == [None] * 3
    assert operator.node.fake.asked == []
    assert operator.controller.view.gear == 1
    assert operator.lines == [f"{key.upper()} ignored: it is older than 0.5 s."]


def test_a_key_without_a_function_is_named_until_the_next_one(operator: Operator) -> None:
    notice = "ц has no function here. SWITCH THE KEYBOARD TO LATIN (ENGLISH)."
    for key, shown in (
        ("ц", notice),
        ("ц", notice),
        ("left_shift", ""),
        ("t", "T has no function here."),
    ):
        operator.press(key)
        assert operator.speeds(1) == [None]
        assert english(operator.controller.view.keystroke_notice) == shown
    operator.press("w")
    operator.ticks(1)
    assert operator.controller.view.keystroke_notice == ()
    assert operator.lines == [notice, "T has no function here."]


def slow(operator: Operator) -> None:
    """Simulate a terminal that answers late from now on."""
    operator.near = False
    answer(operator.controller.terminal, operator.now_ns, 0.42)


@pytest.mark.parametrize("key", ["w", "b", "r"])
def test_on_a_slow_terminal_keys_move_and_reset_nothing(operator: Operator, key: str) -> None:
    operator.tell_contact()
    slow(operator)
    for _ in range(3):
        operator.press(key)
        assert operator.speeds(1) == [None]
    assert operator.node.fake.asked == []
    assert operator.lines == [
        "Keystrokes ignored. Terminal too slow: 0.42 s, limit 0.15 s. "
        "Use `t2 drive` on a machine near the robot, or the dashboard."
    ]
    assert english(operator.controller.view.keyboard_refused) == (
        "Terminal too slow: 0.42 s, limit 0.15 s."
    )
    operator.press("e")
    assert operator.node.fake.estops == 1


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
    operator.near = False
    speeds = []
    for _ in range(20):  # it does not answer any more
        operator.press("w")
        speeds += operator.speeds(1)
    assert speeds[-5:] == [None] * 5
    assert len([line for line in operator.lines if "Keystrokes ignored" in line]) == 2


# --- reset ----------------------------------------------------------------------------------


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
    assert operator.lines[1:] == ["Reset."]


@pytest.mark.parametrize(("boot", "latched"), [(5, True), (77, False)])
def test_a_reset_without_effect_is_not_confirmed(
    operator: Operator, boot: int, latched: bool
) -> None:
    """The latch stays, or another program than safety has answered."""
    operator.tell_contact()
    operator.press("r")
    operator.node.fake.answers[0][0](structs.replace(DONE, boot=boot))
    for _ in range(23):
        if latched:
            operator.tell_contact(heartbeat=8)
        else:
            operator.tell_safety(boot=5, heartbeat=8)
        operator.ticks(1)
    reason = (Phrase("event.reset_unconfirmed"),)
    (line,) = (line for line in operator.node.event_log.lines() if line.phrases == reason)
    assert line.level == "error"


def test_a_refused_reset_is_reported_and_the_next_one_is_sent(operator: Operator) -> None:
    operator.tell_contact()
    operator.press("r")
    operator.press("r")  # the key repeats
    assert len(operator.node.fake.asked) == 1
    operator.node.fake.answers[0][1](Refusal(text="Too old: repeat it."))
    operator.ticks(5)
    assert operator.lines[1:] == ["Too old: repeat it."]
    operator.tell_contact()
    operator.press("r")
    assert len(operator.node.fake.asked) == 2


@pytest.mark.parametrize("denied", [True, False])
def test_an_unanswered_reset_without_the_right_is_not_allowed(
    operator: Operator, monkeypatch: pytest.MonkeyPatch, denied: bool
) -> None:
    monkeypatch.setattr(Publisher, "passed_on", not denied)
    for _ in range(DENIED_AFTER):
        operator.tell_contact()
        operator.ticks(1)
    operator.press("r")
    operator.node.fake.answers[0][1](no_answer("safety"))
    expected = not_allowed("safety") if denied else no_answer("safety")
    assert operator.lines[-1] == expected.text


@pytest.mark.parametrize("shown", [True, False])
def test_a_reset_is_not_sent_without_a_fresh_state(operator: Operator, shown: bool) -> None:
    operator.tell_contact()
    if not shown:
        operator.shown = None
    else:
        operator.wait(0.6)
    operator.press("r")
    assert operator.node.fake.asked == []
    assert operator.lines == ["Reset not sent: no fresh state of safety."]


# --- view -----------------------------------------------------------------------------------


def test_the_view_shows_fresh_values(operator: Operator) -> None:
    operator.node.fake.deliver(keys.SAFETY, safety_state(text="Driving."))
    operator.node.fake.deliver(keys.DRIVER, Driver(faults=("encoder",), bits=4), side="right")
    operator.controller.tick(0)  # a clock behind the messages': nothing is old
    view = operator.controller.view
    assert view.safety is not None
    assert view.safety.text == "Driving."
    assert (view.left, view.right) == (None, Driver(faults=("encoder",), bits=4))
    operator.controller.tick(1 << 62)
    assert operator.controller.view.safety is None


def test_events_of_others_are_shown_and_own_ones_only_once(operator: Operator) -> None:
    fake = operator.node.fake
    everyone = keys.EVENTS.on("001", service="*")
    contact = Event(name="contact", level="error", text="the bumper was hit", boot=5, t_ns=7)
    mine = Event(name="estop", level="info", text="mine", boot=fake.boot)
    fake.deliver(keys.EVENTS, contact, declared=everyone, service="safety")
    fake.deliver(keys.EVENTS, contact, declared=everyone, service="bridge")  # of the same press
    fake.deliver(keys.EVENTS, mine, declared=everyone, service="teleop")
    (line,) = operator.node.event_log.lines()
    assert (line.t_ns, line.service, line.level) == (7, "safety", "error")
