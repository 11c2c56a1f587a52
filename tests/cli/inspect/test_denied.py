"""Messages that a router denies: what the tools report, and what reaches a robot.

Each cell of the table of rights is tried in ``tests/cli/keys/test_rights.py``.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import msgspec
import pytest

from cli.__main__ import main
from cli.inspect import estop
from cli.inspect.client import SafetyClient
from common.bus.bus import Arrival, Bus
from common.bus.probe import probe
from common.bus.session import operator_name
from common.loop import Loop
from common.settings import BusSettings as Where
from common.source import DriveSource
from t2 import client as machine
from t2 import keys
from t2.errors import T2Error
from t2.messages import Drive, Event, ResetRequest
from tests.factories import safety_state
from verification.harness.bus import at, joined, running
from verification.harness.certificates import Site, connecting
from verification.harness.waiting import wait_until

CERTIFIED = ("ca", "certificate", "private_key")


Join = Callable[[Where, str, Callable[[Bus], object]], Bus]


class OnBoard:
    """Subscriptions of safety on one robot."""

    def __init__(self, join: Join, endpoint: str, robot: str = "001") -> None:
        self.received: list[Arrival[Drive]] = []
        self.estops: list[int] = []
        self.events: list[Arrival[Event]] = []
        join(at(endpoint), robot, self.declare)

    def declare(self, bus: Bus) -> None:
        bus.subscribe(keys.DRIVE, self.received.append, source="*")
        for source in ("teleop", "web", "nav"):  # as safety does for each in its settings
            bus.on_any(keys.DRIVE.on(bus.robot, source=source), lambda _: None)
        bus.on_any(keys.estop_key(bus.robot), self.estops.append)
        bus.subscribe(keys.EVENTS, self.events.append, service="estop")
        bus.serve(keys.RESET, lambda _, __: None)
        bus.live(keys.live_key(bus.robot, "safety", "1"))
        self.state = bus.publisher(keys.SAFETY)


class Member:
    """A member's own program."""

    def __init__(self, join: Join, where: Where, robot: str = "001") -> None:
        self.bus = join(where, robot, self.declare)

    def declare(self, bus: Bus) -> None:
        self.source = DriveSource(bus, "teleop")

    def drives(self, robot: OnBoard) -> bool:
        """Return whether its request reaches safety; repeat until it does or is barred."""

        def came() -> bool:
            return any(arrival.message.boot == self.bus.boot for arrival in robot.received)

        def settled() -> bool:
            robot.state.put(safety_state(heartbeat=1))
            self.source.request(0.1, 0.0)
            return came() or self.source.denied

        wait_until(settled, "a request, or the refusal of one")
        return came()


def made(folder: Path) -> Site:
    site = Site(folder / "keys")
    for robot in ("001", "002"):
        site.member("robot", robot, "--address", "127.0.0.1")
    site.member("site", "berlin", "--address", "127.0.0.1")
    site.member("driver", "anna", "--robot", "001")
    site.member("viewer", "hall")
    site.member("fleet", "room")
    return site


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return made(tmp_path_factory.mktemp("site"))


@pytest.fixture
def join() -> Iterator[Join]:
    """Return a function that joins the bus with a program's declarations."""
    with running(Loop()) as loop, ExitStack() as closing:
        yield lambda where, robot, declare: closing.enter_context(
            joined(where, robot, loop, declare)
        )


def test_t2_estop_reports_the_reason_before_the_advice(
    site: Site,
    join: Join,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def stopped(role: str, name: str, robot: str = "001") -> list[str]:
        where = connecting(site.settings(role, name), secured)
        sets = [f"--set=bus.{field}={getattr(where, field)}" for field in CERTIFIED]
        code = main(["estop", "--robot", robot, *sets, f"--set=bus.connect={secured}"])
        assert code == 1
        return capsys.readouterr().err.splitlines()

    monkeypatch.setattr(machine, "ESTOP_TICKS", 10)
    monkeypatch.setattr(estop, "ESTOP_WAIT_S", 0.0)
    with site.router(site.settings("robot", "001")) as (secured, onboard):
        OnBoard(join, onboard)
        reason, advice = stopped("viewer", "hall")
        assert reason.startswith(
            "t2 estop: not allowed: this certificate has no right to stop robot 001 (as it seems: "
        )
        assert "USE THE VEHICLE'S OWN SWITCH, then `t2 doctor --robot 001 --set bus.ca=" in advice
        assert advice.endswith(f" --set bus.connect={secured}`.")
        (advice,) = stopped("driver", "anna")
        assert "does not confirm" in advice
        (unknown,) = stopped("driver", "anna", "009")
        assert "robot 009 is not at this router (seen: 001). If it moves, USE THE" in unknown


@contextmanager
def repeated(call: Callable[[], object]) -> Iterator[None]:
    """Repeat a call in a thread for the context."""
    ended = threading.Event()

    def run() -> None:
        while not ended.wait(0.05):
            call()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def test_t2_doctor_judges_the_rights_of_its_own_certificate(
    join: Join, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def rights(role: str, name: str) -> list[str]:
        where = connecting(site.settings(role, name), secured)
        sets = [f"--set=bus.{field}={getattr(where, field)}" for field in CERTIFIED]
        main(["doctor", "--duration", "1", *sets, f"--set=bus.connect={secured}"])
        lines = capsys.readouterr().out.splitlines()
        return [line for line in lines if line.startswith("rights")]

    def safety(bus: Bus) -> None:
        for topic, source in ((keys.DRIVE, "patrol"), (keys.DRIVE, "web"), (keys.LIMIT, "lidar")):
            bus.on_any(topic.on(bus.robot, source=source), lambda _: None)
        names = ("sources.patrol.priority", "sources.web.priority", "limits.lidar.lease")
        config = {f"safety.{name}": {"value": 1, "origin": "default"} for name in names}
        bus.answer(
            keys.info_key(bus.robot, "safety", "config"),
            lambda: msgspec.json.encode(config),
            "application/json",
        )

    site = Site(tmp_path / "keys")
    site.member("robot", "001", "--address", "127.0.0.1")
    site.member("driver", "planner", "--robot", "001", "--source", "patrol")
    site.member("device", "lidar", "--robot", "001", "--source", "lidar")
    site.member("viewer", "hall")
    with site.router(site.settings("robot", "001")) as (secured, onboard):
        robot = OnBoard(join, onboard)
        join(at(onboard), "001", safety)
        with repeated(lambda: robot.state.put(safety_state(heartbeat=1))):
            (planner,) = rights("driver", "planner")
            assert "ok" in planner.split()
            assert planner.endswith("this laptop may read; drive as patrol")
            (lidar,) = rights("device", "lidar")
            assert lidar.endswith("this laptop may read; limit as lidar")
            (hall,) = rights("viewer", "hall")
            assert "this laptop may only read; as it seems, not stop" in hall


def test_t2_call_reports_why_no_service_answers(site: Site, join: Join) -> None:
    def reason(role: str, name: str, robot: str = "001") -> str:
        with (
            probe(connecting(site.settings(role, name), secured)) as session,
            pytest.raises(T2Error) as error,
        ):
            SafetyClient(session, robot).call(keys.RESET, ResetRequest(), timeout_s=0.3)
        return str(error.value)

    with site.router(site.settings("robot", "001")) as (secured, onboard):
        OnBoard(join, onboard)
        assert "this certificate may not call it" in reason("viewer", "hall")
        assert "safety does not answer" in reason("driver", "anna")
        assert "safety does not answer" in reason("viewer", "hall", "009")


def test_members_reach_their_own_robots_through_the_sites_router(site: Site, join: Join) -> None:
    with (
        site.router(site.settings("site", "berlin")) as (center, _),
        site.router(site.settings("robot", "001"), center) as (_, one),
        site.router(site.settings("robot", "002"), center) as (_, two),
    ):
        first, second = OnBoard(join, one), OnBoard(join, two, "002")
        driver = connecting(site.settings("driver", "anna"), center)
        assert Member(join, driver).drives(first)
        assert not Member(join, driver, "002").drives(second)
        fleet_client = Member(join, connecting(site.settings("fleet", "room"), center), "*")

        def stopped() -> bool:
            fleet_client.bus.estop()
            return bool(first.estops and second.estops)

        wait_until(stopped, "all robots stopped")
        room = connecting(site.settings("fleet", "room"), center)
        with probe(room) as session:
            SafetyClient(session, "001").report_stop("001", operator_name(room))
            wait_until(lambda: first.events, "its event")
        assert first.events[0].message.text.startswith("Emergency stop requested by fleet.room.")


def test_a_revoked_certificate_has_no_rights(join: Join, tmp_path: Path) -> None:
    site = made(tmp_path)
    site.keys("revoke", "driver", "anna")
    with site.router(site.settings("robot", "001")) as (secured, onboard):
        robot = OnBoard(join, onboard)
        anna = Member(join, connecting(site.settings("driver", "anna"), secured))
        hall = Member(join, connecting(site.settings("viewer", "hall"), secured))
        assert not hall.drives(robot)  # by then it has received safety's state
        for _ in range(20):
            anna.source.request(0.1, 0.0)
        assert anna.source.request(0.1, 0.0).echo == 0  # it receives no heartbeat
        assert not robot.received
