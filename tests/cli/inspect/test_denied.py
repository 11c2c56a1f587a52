"""Messages that a router denies: what the tools report, and what reaches a robot.

Each cell of the table of rights is tried in ``tests/cli/keys/test_rights.py``.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import msgspec
import pytest

from cli.__main__ import main
from cli.inspect import estop
from cli.inspect.client import SafetyClient
from common.bus.bus import Arrival, Bus
from common.bus.inspector import inspecting
from common.bus.session import operator_name
from common.loop import Loop
from common.settings import BusSettings as Where
from common.source import DriveSource
from t2 import client as machine
from t2 import keys
from t2.messages import Drive, Event
from tests.cli.inspect.tool import FakeSafety
from tests.common.bus_fixture import BusFixture
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
    site.member("driver", "planner", "--robot", "001", "--source", "patrol")
    site.member("device", "lidar", "--robot", "001", "--source", "lidar")
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


def declare(bus: Bus) -> None:
    """Declare what safety does for its sources, and a reset that it never answers."""
    for topic, source in ((keys.DRIVE, "patrol"), (keys.LIMIT, "lidar")):
        bus.on_any(topic.on(bus.robot, source=source), lambda _: None)
    names = ("sources.patrol.priority", "sources.web.priority", "limits.lidar.lease")
    config = {f"safety.{name}": {"value": 1, "origin": "default"} for name in names}
    key = keys.info_key(bus.robot, "safety", "config")
    bus.answer(key, lambda: msgspec.json.encode(config), "application/json")
    bus.serve(keys.RESET, lambda _, __: None)


def test_the_tools_report_what_a_certificate_may_not_do(
    site: Site, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def lines(role: str, name: str, *words: str) -> list[str]:
        where = connecting(site.settings(role, name), secured)
        sets = [f"--set=bus.{field}={getattr(where, field)}" for field in CERTIFIED]
        assert main([*words, *sets, f"--set=bus.connect={secured}"]) == 1
        return "".join(capsys.readouterr()).splitlines()

    monkeypatch.setattr(machine, "ESTOP_TICKS", 10)
    monkeypatch.setattr(estop, "ESTOP_WAIT_S", 0.0)
    robot = site.settings("robot", "001")
    with site.router(robot) as (secured, onboard), BusFixture(onboard) as buses:
        buses.robot = "001"
        FakeSafety(buses, declare, obeys=False)
        reason, advice = lines("viewer", "hall", "estop")
        assert reason.startswith(
            "t2 estop: not allowed: this certificate has no right to stop robot 001 (as it seems: "
        )
        assert "USE THE VEHICLE'S OWN SWITCH, then `t2 doctor --robot 001 --set bus.ca=" in advice
        assert advice.endswith(f" --set bus.connect={secured}`.")
        (advice,) = lines("driver", "anna", "estop")
        assert "does not confirm" in advice
        (unknown,) = lines("driver", "anna", "estop", "--robot", "009")
        assert "robot 009 is not at this router (seen: 001). If it moves, USE THE" in unknown
        (refused,) = lines("viewer", "hall", "call", "safety/reset")
        assert "this certificate may not call it" in refused
        (late,) = lines("driver", "anna", "call", "safety/reset")
        assert "safety does not answer" in late
        assert "may not call it" not in late
        for role, name, text in (
            ("driver", "planner", "this laptop may read; drive as patrol"),
            ("device", "lidar", "this laptop may read; limit as lidar"),
            ("viewer", "hall", "only read; as it seems, not stop: use the vehicle's own switch"),
        ):
            found = lines(role, name, "doctor", "--duration", "1")
            (rights,) = (line for line in found if line.startswith("rights"))
            assert rights.endswith(text)


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
        with inspecting(room) as session:
            SafetyClient(session, "001").report_stop("001", operator_name(room))
            wait_until(lambda: first.events, "its event")
        assert first.events[0].message.text.startswith("Emergency stop by fleet.room.")


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
