"""Emergency stop of one robot, a site or all, and the list of robots."""

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from unittest.mock import Mock

import pytest

from cli.inspect import estop, robots
from cli.inspect.client import SafetyClient
from common.bus.bus import Arrival, Bus
from common.bus.session import operator_name
from common.cli_args import EXIT_LINK
from t2 import client as machine
from t2 import keys
from t2.messages import Cause, Event
from tests.cli.inspect.tool import FakeSafety, Tool, pretend
from tests.common.bus_fixture import BusFixture
from verification.harness.bus import at, router_process
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

Join = Callable[[str], BusFixture]
USER = operator_name(at("tcp/127.0.0.1:1"))  # without a certificate: login name and host


@pytest.fixture
def join(shared_router: str) -> Iterator[Join]:
    """Return a robot of that name, on the shared router."""
    with contextlib.ExitStack() as stack:

        def made(name: str) -> BusFixture:
            buses = BusFixture(shared_router)
            buses.robot = name
            return stack.enter_context(buses)

        yield made


@pytest.fixture
def t2(shared_router: str, capsys: pytest.CaptureFixture[str]) -> Tool:
    """Run ``t2`` without a robot's name."""
    return Tool(shared_router, "", capsys)


# --- estop ------------------------------------------------------------------------------------


def test_stop_of_one_site(join: Join, t2: Tool) -> None:
    events: list[Arrival[Event]] = []

    def record(bus: Bus) -> None:
        bus.subscribe(keys.EVENTS, events.append, service="*")

    berlin = [FakeSafety(join(name), record) for name in ("berlin-001", "berlin-002")]
    others = [FakeSafety(join(name)) for name in ("munich-001", "berlinale-001", "001")]
    result = t2("estop", "--site", "berlin")
    assert (result.code, result.err) == (0, "")
    assert [line.split()[1] for line in result.out.splitlines()] == ["berlin-001", "berlin-002"]
    assert all(each.stops for each in berlin)
    assert not any(each.stops for each in others)
    wait_until(lambda: len(events) == 2, "an event for each robot")
    key, event = events[0].key, events[0].message
    assert key in ("t2/v1/berlin-001/evt/estop", "t2/v1/berlin-002/evt/estop")
    assert (event.name, event.text) == ("estop", f"Emergency stop by {USER}.")
    assert event.about == {"by": USER}


def test_unconfirmed_robots_are_named(
    join: Join, t2: Tool, monkeypatch: pytest.MonkeyPatch
) -> None:
    FakeSafety(join("berlin-001"))
    FakeSafety(join("berlin-002"), obeys=False)
    pretend(join("berlin-003"), "bridge", {})  # its safety has died
    pretend(join("berlin-004"), "dashboard", {})  # a laptop
    monkeypatch.setattr(machine, "ESTOP_TICKS", 20)
    monkeypatch.setattr(estop, "ESTOP_WAIT_S", 2.0)
    result = t2("estop", "--site", "berlin")
    assert result.code == 1
    assert "Robot berlin-001 is stopped." in result.out
    assert "berlin-002 is stopped" not in result.out
    for name in ("berlin-002", "berlin-003"):
        assert f"robot {name} does not confirm. USE THE VEHICLE'S OWN SWITCH" in result.err
        assert name in result.err.splitlines()[-1]
    assert "has not confirmed it within 2 s: repeated no longer. USE THE" in result.err
    assert "berlin-004" not in result.err


def test_a_stop_is_repeated_for_a_robot_that_confirms_late(
    join: Join, t2: Tool, monkeypatch: pytest.MonkeyPatch
) -> None:
    safety = FakeSafety(join("berlin-001"), obeys=False)
    monkeypatch.setattr(machine, "ESTOP_TICKS", 6)
    obeys = threading.Timer(2.0, lambda: setattr(safety, "_obeys", True))
    obeys.start()
    result = t2("estop", "--robot", "berlin-001")
    obeys.join()
    assert (result.code, "Robot berlin-001 is stopped." in result.out) == (0, True)
    doubt, repeats = result.err.splitlines()
    assert "does not confirm. USE THE VEHICLE'S OWN SWITCH" in doubt
    assert repeats.startswith("t2 estop: the order is repeated for ")


def test_a_latched_stop_that_the_board_may_not_hear_is_no_stop(join: Join, t2: Tool) -> None:
    lost = Cause(name="link", action="stop", age=1.0, text="The link to the board is down.")
    FakeSafety(join("berlin-001"), causes=(lost,))
    result = t2("estop", "--robot", "berlin-001")
    assert (result.code, result.out) == (1, "")
    assert (
        "receives nothing from the vehicle. USE THE VEHICLE'S OWN SWITCH, then `t2 doctor"
        in result.err
    )


def test_a_driver_of_some_robots_stops_them_by_name(
    join: Join, t2: Tool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Access rules allow the keys of its own robots, but not a key expression."""
    stopped = FakeSafety(join("berlin-001"))
    order = SafetyClient.order_stop
    monkeypatch.setattr(
        SafetyClient, "order_stop", lambda self, to: None if "*" in to else order(self, to)
    )
    assert t2("estop", "--all").code == 0
    assert stopped.stops


def test_a_stop_without_a_router_is_not_sent(t2: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    nowhere = Tool(f"tcp/127.0.0.1:{free_port()}", "001", t2.capsys)
    monkeypatch.setattr("cli.inspect.estop.time.sleep", Mock(side_effect=KeyboardInterrupt))
    result = nowhere("estop")
    assert (result.code, result.out) == (128 + signal.SIGINT, "")
    assert "NOT SENT YET, USE THE VEHICLE'S OWN SWITCH. It is sent if" in result.err
    assert "ended by Ctrl-C before the stop was confirmed: USE THE" in result.err
    monkeypatch.setattr(estop, "ESTOP_WAIT_S", -1.0)
    result = nowhere("estop")
    assert (result.code, result.out) == (EXIT_LINK, "")
    assert "NOT SENT, USE THE VEHICLE'S OWN SWITCH" in result.err
    assert f"no router answers at {nowhere.endpoint}" in result.err
    assert "t2 doctor" in result.err


def test_a_stop_waits_for_a_restarted_router(t2: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "ESTOP_TICKS", 6)
    monkeypatch.setattr(estop, "insist", lambda *_: set())
    where = f"tcp/127.0.0.1:{free_port()}"
    with contextlib.ExitStack() as stack:
        late = threading.Timer(1.0, lambda: stack.enter_context(router_process(where)))
        late.start()
        result = Tool(where, "001", t2.capsys)("estop")
        late.join()
    assert "sent; safety of robot 001 does not confirm" in result.err


@pytest.mark.parametrize(
    ("words", "phrase"),
    [
        (("estop", "--site", "north-east"), "'north-east' is not a site"),
        (("call", "safety/reset", "--robot", "berlin-$*"), "one robot at a time"),
        (("doctor", "--robot", "*"), "one robot at a time"),
        (("hz", "tel/x", "--duration", "nan"), "--duration"),
    ],
)
def test_invalid_arguments(words: tuple[str, ...], phrase: str, t2: Tool) -> None:
    result = t2(*words)
    assert (result.code, result.out) == (2, "")
    assert phrase in result.err


# --- robots -----------------------------------------------------------------------------------


def test_list_of_robots(join: Join, t2: Tool) -> None:
    one = join("berlin-001")
    FakeSafety(one)
    pretend(one, "bridge", {})
    FakeSafety(join("munich-001"))
    result = t2("robots")
    assert (result.code, result.err) == (0, "")
    first, second = result.lines
    assert first == {
        "robot": "berlin-001", "services": ["bridge", "safety"], "verdict": "run", "latched": [],
        "source": "teleop", "text": "Driving.",
    }  # fmt: skip
    assert second["robot"] == "munich-001"
    assert [line["robot"] for line in t2("robots", "--site", "munich").lines] == ["munich-001"]
    assert [line["robot"] for line in t2("robots", robot="berlin-001").lines] == ["berlin-001"]


def test_silent_robots_are_listed(join: Join, t2: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robots, "LISTEN_S", 0.3)
    for name, service in (("a", "safety"), ("b", "bridge"), ("c", "odom"), ("d", "dashboard")):
        pretend(join(name), service, {})
    result = t2("robots")
    assert result.code == 1
    verdicts = {line["robot"]: line["verdict"] for line in result.lines}
    assert verdicts == {"a": "silent", "b": "no safety", "c": "no safety"}
    assert t2("robots", robot="b").code == 1
    for command, words in (
        ("robots", ("--site", "nowhere")),
        ("estop", ("--site", "nowhere")),
        ("robots", ("--robot", "d")),
    ):
        result = t2(command, *words)
        assert (result.code, result.out) == (1, "")
        assert "no robot found" in result.err
