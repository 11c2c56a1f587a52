"""The driver of one robot on the dashboard: overruled by another source, or without permission."""

from typing import Any

import pytest

from common import keys
from common.bus.publisher import Publisher
from common.client import DENIED_AFTER, ESTOP_TICKS, OVERRULED_TICKS
from common.messages import Direction, Drive, ResetDone, ResetRequest
from services.dashboard.config import Dashboard
from services.dashboard.driver_lock import HoldState, Push
from services.dashboard.robot import Robot
from tests.dashboard.servers import CONTACT, NEWER
from tests.factories import safety_state
from tests.fake_bus import FakeBus

TICK_NS = 50_000_000


class RobotFixture:
    """A robot whose driver holds the stick forward, with a state of safety in each tick."""

    def __init__(self) -> None:
        self.bus = FakeBus()
        self.notices: list[tuple[str, str, str]] = []
        self.robot = Robot(
            self.bus,
            Dashboard(),
            lambda *words: self.notices.append(words),
        )
        self.now_ns = 0
        self.delay_ns = 0  # of the browser's answers
        self.release: Direction | None = None
        self.latched: tuple[str, ...] = ()
        assert self.robot.driver_lock.take("1", force=False)

    def ticks(self, number: int, source: str | None, *, held: bool = True) -> None:
        lock = self.robot.driver_lock
        for _ in range(number):
            self.now_ns += TICK_NS
            state = safety_state(heartbeat=self.now_ns, source=source, latched=self.latched)
            self.bus.deliver(keys.SAFETY, state, self.now_ns)
            if held:
                push = Push(release=self.release) if self.release else Push(1.0)
                shown = self.robot.telemetry.shown(self.now_ns - self.delay_ns)
                lock.hold("1", push, shown, self.now_ns)
            else:
                lock.let_go("1")
            self.robot.tick(self.now_ns)

    def is_held(self) -> bool:
        """Whether the hold is valid; otherwise the driver must let go first."""
        return self.robot.driver_lock.state is HoldState.HELD

    def overruled_by(self) -> str | None:
        driver = self.robot.driver_state()
        return driver.other if driver.overruled else None


@pytest.fixture
def fixture() -> RobotFixture:
    return RobotFixture()


def test_a_driver_who_is_overruled_must_let_go_first(fixture: RobotFixture) -> None:
    fixture.ticks(5, "web")
    fixture.ticks(OVERRULED_TICKS - 1, "teleop")
    assert fixture.overruled_by() is None  # our first requests may be on their way
    assert fixture.is_held()
    fixture.ticks(1, "teleop")
    assert not fixture.is_held()
    assert fixture.overruled_by() == "teleop"
    fixture.ticks(20, None)
    assert fixture.overruled_by() is None
    assert not fixture.is_held()
    fixture.ticks(1, None, held=False)
    fixture.ticks(5, "web")
    assert fixture.is_held()


def test_a_driver_who_takes_over_is_not_overruled(fixture: RobotFixture) -> None:
    fixture.ticks(OVERRULED_TICKS - 1, "nav")  # until our first requests are decided
    fixture.ticks(40, "web")
    assert fixture.is_held()


def test_nobody_is_overruled_who_holds_no_control(fixture: RobotFixture) -> None:
    fixture.ticks(20, "nav", held=False)
    assert fixture.overruled_by() is None
    assert fixture.robot.driver_state().other == "nav"


def test_a_request_echoes_what_the_driver_was_shown_and_a_zero_the_newest(
    fixture: RobotFixture,
) -> None:
    requests = next(p for p in fixture.bus.publishers if p.topic is keys.DRIVE)
    fixture.ticks(5, "web")
    fixture.delay_ns = 3 * TICK_NS
    fixture.ticks(1, "web")
    assert isinstance(requests.last, Drive)
    assert (requests.last.linear, requests.last.echo) == (0.2, fixture.now_ns - 3 * TICK_NS)
    fixture.ticks(1, "web", held=False)
    assert (requests.last.linear, requests.last.echo) == (0.0, fixture.now_ns)


def test_a_release_is_requested_after_a_neutral_request(fixture: RobotFixture) -> None:
    requests = next(p for p in fixture.bus.publishers if p.topic is keys.DRIVE)
    directions: tuple[Direction, ...] = ("backward", "forward")
    for fixture.release in (None, *directions):
        for expected in ("none", fixture.release or "none"):
            fixture.ticks(1, "web")
            assert isinstance(requests.last, Drive)
            assert requests.last.release == expected


def test_an_unconfirmed_estop_is_reported(fixture: RobotFixture) -> None:
    fixture.robot.estop("a test")
    fixture.ticks(ESTOP_TICKS, None)
    assert fixture.notices == [("error", "estop_unconfirmed", "")]


def test_a_repeated_estop_is_logged_once(
    fixture: RobotFixture, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A page sends it by WebSocket and by POST, and repeats it until it sees the latch."""
    fixture.robot.estop("a page")
    fixture.robot.estop("a page")
    fixture.latched = ("estop",)
    fixture.ticks(3, None)
    monkeypatch.setattr("common.clock.now_ns", lambda: fixture.now_ns)
    fixture.robot.estop("a page")
    assert [record.getMessage() for record in caplog.records].count("emergency stop") == 1
    fixture.ticks(1, None)
    fixture.latched = ()
    fixture.ticks(1, None)
    fixture.robot.estop("a page")
    assert [record.getMessage() for record in caplog.records].count("emergency stop") == 2


def test_a_viewer_has_no_driver(fixture: RobotFixture, monkeypatch: pytest.MonkeyPatch) -> None:
    assert fixture.robot.may_drive
    monkeypatch.setattr(Publisher, "passed_on", False)
    fixture.ticks(DENIED_AFTER, None)
    driver = fixture.robot.driver_state()
    assert (driver.may, driver.id) == (False, None)
    assert fixture.notices == [("error", "barred", "")]
    fixture.robot.estop("a test")
    fixture.ticks(ESTOP_TICKS, None)
    assert fixture.notices[1:] == [("error", "estop_denied", "")]


@pytest.fixture
def reset(fixture: RobotFixture) -> RobotFixture:
    """A driver who has reset a contact, after which safety published a newer one."""
    for heartbeat, cause in ((1, CONTACT), (2, NEWER)):
        state = safety_state(heartbeat=heartbeat, latched=("contact",), causes=(cause,))
        fixture.bus.deliver(keys.SAFETY, state, 0)
    fixture.robot.reset(1, lambda *words: fixture.notices.append(words))
    return fixture


def answer(fixture: RobotFixture, **fields: int) -> None:
    done: dict[str, Any] = {"text": "Reset.", "boot": 0, "heartbeat": 3, "cleared": (CONTACT.id,)}
    fixture.bus.answers[-1][0](ResetDone(**done | fields))


def test_a_reset_names_what_the_screen_showed(reset: RobotFixture) -> None:
    assert reset.bus.asked == [(keys.RESET.path, ResetRequest(echo=1, causes=(CONTACT.id,)))]


@pytest.mark.parametrize(
    ("latched", "notice"),
    [((), ("info", "Reset.", "reset_done")), (("estop",), ("warning", "Reset.", "reset_partial"))],
)
def test_a_reset_is_confirmed_by_the_state_of_safety(
    reset: RobotFixture, latched: tuple[str, ...], notice: tuple[str, str, str]
) -> None:
    answer(reset)
    assert reset.notices == []
    reset.latched = latched
    reset.ticks(1, "web")
    assert reset.notices == [notice]


def test_an_answer_that_is_not_safetys_is_not_confirmed(reset: RobotFixture) -> None:
    answer(reset, boot=1)
    reset.ticks(40, "web")
    assert reset.notices == [("error", "reset_unconfirmed", "")]


def test_a_refusal_is_reported(reset: RobotFixture) -> None:
    reset.bus.answers[-1][1]("The call is 1.4 s old.")
    assert reset.notices == [("warning", "The call is 1.4 s old.", "reset_refused")]
