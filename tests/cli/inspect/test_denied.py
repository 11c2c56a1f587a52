"""What members see of their rights, on their own robot and through their site's router."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
import zenoh

from common import keys
from common.bus.bus import Arrival, Bus
from common.bus.session import client_config
from common.loop import Loop
from common.messages import Drive, ResetDone, ResetRequest
from common.settings import BusSettings as Where
from common.source import DriveSource
from tests.teleop.support import safety_state
from verification.harness.certificates import Site, dialling
from verification.harness.support import at, joined, running, wait_until


class OnBoard:
    """Safety's ears on one robot: what arrives there."""

    def __init__(self, bus: Bus) -> None:
        self.heard: list[Arrival[Drive]] = []
        self.estops: list[int] = []
        bus.subscribe(keys.DRIVE, self.heard.append, source="*")
        for source in ("teleop", "web", "nav"):  # as safety does for each configured source
            bus.on_any(keys.DRIVE.on(bus.robot, source=source), lambda _: None)
        bus.on_any(keys.estop_key(bus.robot), self.estops.append)
        bus.serve(keys.RESET, lambda _, caller: caller.reply(ResetDone(text="reset")))
        self.state = bus.publisher(keys.SAFETY)


class Member:
    """A member's own program."""

    def __init__(self, bus: Bus, source: str) -> None:
        self.bus = bus
        self.source = DriveSource(bus, source)
        self.told: list[str] = []

    def reset(self) -> str:
        """Ask for a reset, and return what came of it."""
        self.told.clear()
        self.bus.ask(
            keys.RESET, ResetRequest(), lambda done: self.told.append(done.text),
            self.told.append, timeout_s=1.0,
        )  # fmt: skip
        return wait_until(lambda: self.told, "an answer")[0]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    made = Site(tmp_path_factory.mktemp("site") / "keys")
    for robot in ("001", "002"):
        made.member("robot", robot, "--address", "127.0.0.1")
    made.member("site", "berlin", "--address", "127.0.0.1")
    made.member("driver", "anna", "--robot", "001")
    made.member("driver", "planner", "--robot", "001", "--source", "nav")
    made.member("viewer", "hall")
    made.member("fleet", "room")
    return made


@pytest.fixture
def loop() -> Iterator[Loop]:
    with running(Loop()) as it:
        yield it


@pytest.fixture
def join(loop: Loop) -> Iterator[Callable[..., Bus]]:
    """Let programs join the bus, each with its declarations."""
    with ExitStack() as closing:
        yield lambda where, robot, declare: closing.enter_context(
            joined(where, robot, loop, declare)
        )


def on_board(join: Callable[..., Bus], endpoint: str, robot: str = "001") -> OnBoard:
    made: list[OnBoard] = []
    join(at(endpoint), robot, lambda bus: made.append(OnBoard(bus)))
    return made[0]


def member(
    join: Callable[..., Bus], where: Where, robot: str = "001", source: str = "teleop"
) -> Member:
    made: list[Member] = []
    join(where, robot, lambda bus: made.append(Member(bus, source)))
    return made[0]


def drives(it: Member, robot: OnBoard) -> bool:
    """Let a member ask until safety has it, or the member knows that it never will."""

    def came() -> bool:
        return any(arrival.message.boot == it.bus.boot for arrival in robot.heard)

    def settled() -> bool:
        robot.state.put(safety_state(heartbeat=1))
        it.source.ask(0.1, 0.0)
        return came() or it.source.denied

    wait_until(settled, "a request, or the refusal of one")
    return came()


def test_a_driver_drives_and_a_viewer_is_told_that_it_may_not(
    site: Site, join: Callable[..., Bus]
) -> None:
    with site.router(site.settings("robot", "001")) as (secured, onboard):
        robot = on_board(join, onboard)
        anna = member(join, dialling(site.settings("driver", "anna"), secured))
        hall = member(join, dialling(site.settings("viewer", "hall"), secured))
        assert drives(anna, robot)
        assert not drives(hall, robot)
        assert not anna.source.denied
        assert anna.reset() == "reset"
        assert hall.reset() == "safety does not answer; `t2 doctor` tells why"
        hall.bus.estop()
        anna.bus.estop()
        wait_until(lambda: robot.estops, "Anna's stop")
        assert len(robot.estops) == 1


def test_a_certificate_is_bound_to_its_sources_and_who_uses_another_is_told(
    site: Site, join: Callable[..., Bus]
) -> None:
    with site.router(site.settings("robot", "001")) as (secured, onboard):
        robot = on_board(join, onboard)
        planner = member(join, dialling(site.settings("driver", "planner"), secured), source="nav")
        assert drives(planner, robot)
        stolen = member(join, dialling(site.settings("driver", "planner"), secured))
        anna = member(join, dialling(site.settings("driver", "anna"), secured), source="nav")
        assert not drives(stolen, robot), "it took teleop's priority"
        assert not drives(anna, robot)
        assert stolen.source.denied
        assert anna.source.denied


def test_through_the_sites_router_each_reaches_its_own(
    site: Site, join: Callable[..., Bus]
) -> None:
    with (
        site.router(site.settings("site", "berlin")) as (center, _),
        site.router(site.settings("robot", "001"), center) as (_, one),
        site.router(site.settings("robot", "002"), center) as (_, two),
    ):
        first, second = on_board(join, one), on_board(join, two, "002")
        driver = dialling(site.settings("driver", "anna"), center)
        assert drives(member(join, driver), first)
        assert not drives(member(join, driver, "002"), second)
        everybody = member(join, dialling(site.settings("fleet", "room"), center), "*")

        def stopped() -> bool:
            everybody.bus.estop()
            return bool(first.estops and second.estops)

        wait_until(stopped, "all robots stopped")


def test_what_is_safetys_alone_does_not_come_down_the_uplink(site: Site) -> None:
    motion, stop = keys.MOTION.on("001"), keys.estop_key("001")
    heard: list[str] = []
    with (
        site.router(site.settings("site", "berlin")) as (center, room),
        site.router(site.settings("robot", "001"), center) as (_, onboard),
        zenoh.open(client_config(at(onboard))) as safety,
        zenoh.open(client_config(at(room))) as somebody,
    ):
        ears = [safety.declare_subscriber(key, lambda s: heard.append(str(s.key_expr)))
                for key in (motion, stop)]  # fmt: skip

        def passed() -> bool:
            for key in (motion, stop):
                somebody.put(key, b"", congestion_control=zenoh.CongestionControl.BLOCK)
            return bool(heard)

        wait_until(passed, "a stop from the site")
        assert set(heard) == {stop}
        for ear in ears:
            ear.undeclare()


@contextmanager
def revoked(site: Site, tmp_path: Path) -> Iterator[None]:
    """Take Anna off the list while the context lasts."""
    listed = site.folder / "members.json"
    before = listed.read_bytes()
    site.keys("revoke", "driver", "anna")
    try:
        yield
    finally:
        listed.write_bytes(before)


def test_a_revoked_certificate_passes_and_may_do_nothing(
    site: Site, join: Callable[..., Bus], tmp_path: Path
) -> None:
    with (
        revoked(site, tmp_path),
        site.router(site.settings("robot", "001")) as (secured, onboard),
    ):
        robot = on_board(join, onboard)
        anna = member(join, dialling(site.settings("driver", "anna"), secured))
        hall = member(join, dialling(site.settings("viewer", "hall"), secured))
        assert not drives(hall, robot)  # and it has heard safety by then
        for _ in range(20):
            anna.source.ask(0.1, 0.0)
        assert anna.source.ask(0.1, 0.0).echo == 0  # it hears nothing
        assert not robot.heard
