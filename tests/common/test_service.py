"""A service's life, from its settings to its exit code, as a real process."""

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import pytest
import zenoh

from common.bus.bus import Bus
from common.bus.publisher import Publisher
from common.bus.session import ONE_POOL, RUNTIME_ENV
from common.cli_args import EXIT_CONFIG, EXIT_LINK, VERSION
from common.config import Sources, load
from common.freshness import NS_PER_S
from common.service import Node, run, serve
from common.settings import Shared
from t2 import codec, keys
from t2.messages import MAX_TEXT, Event, Health, Settings
from tests.cli.processes import running
from tests.common.bus_fixture import BusFixture
from tests.common.systemd_manager import Manager
from verification.harness.bus import set_options
from verification.harness.waiting import PATIENCE_S, wait_until


def specimen(
    log: Path, kind: str, endpoint: str, robot: str
) -> contextlib.AbstractContextManager["subprocess.Popen[bytes]"]:
    """Run the example service on a router, with its log in a file."""
    given = set_options(f"bus.connect={endpoint}", f"robot.id={robot}")
    return running([sys.executable, "-m", "tests.common.example_service", kind, *given], log)


# --- settings -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--set", "bus.lease=99"],
         "--set bus.lease=99: bus.lease = 99: Expected `float` <= 10.0; allowed is 0.2..10.0 s"),
        (["--config", "none.toml"], "none.toml: cannot be read: No such file or directory"),
    ],
)  # fmt: skip
def test_a_wrong_setting_ends_it_before_anything_is_built(
    capsys: pytest.CaptureFixture[str], words: list[str], text: str
) -> None:
    built: list[Node[Shared]] = []
    assert run("odom", Shared, built.append, words) == EXIT_CONFIG == 78
    assert built == []
    assert capsys.readouterr().err == f"odom: {text}\n"


def test_what_cannot_be_opened_ends_it(shared_router: str, tmp_path: Path) -> None:
    log = tmp_path / "log"
    with specimen(log, "refused", shared_router, "refused") as it:
        assert it.wait(PATIENCE_S) == EXIT_LINK == 69
    assert json.loads(log.read_text())["event"] == "port 4002 is taken"


# --- on a router --------------------------------------------------------------------------------


class Witness:
    """Receives health, settings, events and liveliness tokens of a service."""

    def __init__(self, robot: str) -> None:
        self.health: list[Health] = []
        self.settings: list[Settings] = []
        self.events: list[Event] = []
        self.tokens: list[tuple[str, bool]] = []
        self.robot = robot

    def declare(self, bus: Bus) -> None:
        bus.subscribe(keys.HEALTH, lambda a: self.health.append(a.message), service="*")
        bus.subscribe(keys.SETTINGS, lambda a: self.settings.append(a.message), service="*")
        bus.subscribe(keys.EVENTS, lambda a: self.events.append(a.message), depth=99, service="*")
        bus.watch_live(
            keys.live_key(self.robot, "*", "*"), lambda key, on: self.tokens.append((key, on))
        )


Lived = tuple[BusFixture, Path, Witness]


@pytest.fixture(scope="module")
def lived(shared_router: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lived]:
    """Run one service for all the tests that only look at it."""
    log = tmp_path_factory.mktemp("lived") / "log"
    with BusFixture(shared_router) as buses:
        witness = Witness(buses.robot)
        buses.bus(witness.declare)
        with specimen(log, "plain", shared_router, buses.robot):
            wait_until(lambda: len(witness.health) >= 2, "health")
            yield buses, log, witness


def info(buses: BusFixture, part: str) -> dict[str, object]:
    """Return the reply of the service to an info query."""
    session: zenoh.Session = buses.session()
    (reply,) = session.get(keys.info_key(buses.robot, "specimen", part))
    assert reply.ok is not None
    assert str(reply.ok.encoding) == "application/json"
    found: dict[str, object] = json.loads(reply.ok.payload.to_bytes())
    return found


def test_its_health_comes_every_second(lived: Lived) -> None:
    buses, _, witness = lived
    first, last = witness.health[0], witness.health[-1]
    assert last.service == "specimen"
    assert last.version == VERSION
    assert last.uptime > first.uptime >= 0
    assert last.boot == first.boot != 0
    assert last.counters["resets"] == 1
    assert 1_000_000 < last.rss < 10**10
    assert last.lateness >= 0
    bumper = keys.BUMPER.on(buses.robot)
    wait_until(lambda: witness.health[-1].rates.get(bumper, 0) > 1, "the bumper's rate")
    # By the time that has passed, not by that which should have: never more than it is due.
    assert max(health.rates.get(bumper, 0) for health in witness.health) < 60


def test_its_events_reach_who_was_not_there_yet(lived: Lived) -> None:
    buses, log, _ = lived
    witness = Witness(buses.robot)
    buses.bus(witness.declare)
    wait_until(lambda: witness.events, "the event")
    assert witness.events[0].name == "gamepad"
    assert witness.events[0].about == {"device": "pad"}
    logged = [json.loads(line) for line in log.read_text().splitlines() if "event_name" in line]
    assert [(e["event"], e["event_name"], e["level"]) for e in logged] == [
        ("Gamepad: pad.", "gamepad", "info")
    ]


def test_its_schemas_settings_and_last_values_are_looked_up(lived: Lived) -> None:
    buses, _, _ = lived
    schemas, settings = info(buses, "schema"), info(buses, "config")
    own = {"tel/{service}/health", "tel/{service}/settings", "evt/{service}"}
    assert set(schemas) == {"tel/bridge/bumper", *own}
    assert "pressed" in json.dumps(schemas["tel/bridge/bumper"])
    assert settings["robot.id"] == {"value": buses.robot, "origin": f"--set robot.id={buses.robot}"}
    assert settings["bus.lease"] == {"value": 1.0, "origin": "default"}
    last = msgspec.convert(info(buses, "last"), dict[str, dict[str, object]])
    assert last[keys.BUMPER.on(buses.robot)]["pressed"] is True
    assert last[keys.HEALTH.on(buses.robot, service="specimen")]["service"] == "specimen"


def test_its_settings_are_published_as_they_are_answered(lived: Lived) -> None:
    buses, _, witness = lived
    wait_until(lambda: witness.settings, "the settings")
    (published, *_) = witness.settings
    assert json.loads(msgspec.json.encode(published.settings)) == info(buses, "config")
    assert published.settings["bus.listen"].value == ("tcp/127.0.0.1:7447",)
    assert published.boot == witness.health[0].boot


def test_a_bug_of_ours_ends_it_though_its_session_is_open(
    shared_router: str, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    with specimen(log, "failing", shared_router, "failing") as it:
        assert it.wait(PATIENCE_S) == 1
    assert "RuntimeError: a bug of ours" in log.read_text()


def test_sigterm_ends_it_with_its_token_though_it_finds_no_rest(
    buses: BusFixture, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    witness = Witness(buses.robot)
    buses.bus(witness.declare)
    with specimen(log, "restless", buses.endpoint, buses.robot) as it:
        wait_until(lambda: witness.tokens and witness.health, "the token")
        key = keys.live_key(buses.robot, "specimen", f"{witness.health[0].boot:x}")
        it.terminate()
        assert it.wait(PATIENCE_S) == 0
    assert log.read_text().index("stopping") < log.read_text().index("stopped")
    wait_until(lambda: witness.tokens == [(key, True), (key, False)], "the token's end")


# --- in this process ----------------------------------------------------------------------------


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> Node[Shared]:
    """A service without a router."""
    monkeypatch.delenv(RUNTIME_ENV, raising=False)
    given = ["bus.connect=tcp/127.0.0.1:1"]
    return Node("teleop", load(Shared, Sources(environ={}, sets=given)))


@pytest.mark.parametrize("first", ["a bug", "a signal"])
def test_signals_while_it_leaves_do_not_begin_its_exit_anew(
    node: Node[Shared], first: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended: list[int] = []
    said: list[str] = []
    monkeypatch.setattr(os, "_exit", ended.append)

    def on_exit() -> None:
        said.append("begun")
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGINT):
            signal.raise_signal(number)
        said.append("over")

    def begin(_: int) -> None:
        if first == "a bug":
            raise ZeroDivisionError
        signal.raise_signal(signal.SIGINT)

    node.on_exit = on_exit
    node.loop.every(1.0, begin)
    with contextlib.suppress(ZeroDivisionError):
        serve(node)
    assert said == ["begun", "over"]
    assert ended == []


def test_a_second_signal_that_arrives_while_the_first_one_is_handled_ends_it(
    node: Node[Shared], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The guard sends two at once, for BRAKE instead of STOP."""
    ended: list[int] = []
    monkeypatch.setattr(os, "_exit", ended.append)
    stop, install, second = node.loop.stop, signal.signal, iter([signal.SIGTERM])

    def before(call: Callable[..., object]) -> Callable[..., object]:
        def called(*arguments: object) -> object:
            for number in second:
                signal.raise_signal(number)
            return call(*arguments)

        return called

    def begin(_: int) -> None:
        monkeypatch.setattr(signal, "signal", before(install))
        monkeypatch.setattr(node.loop, "stop", before(stop))
        signal.raise_signal(signal.SIGINT)

    node.loop.every(1.0, begin)
    serve(node)
    assert ended == [128 + signal.SIGTERM]


def test_systemd_learns_that_it_is_ready_and_lives_from_its_loop_and_that_it_stops(
    node: Node[Shared], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with contextlib.closing(Manager(str(tmp_path / "notify"))) as manager:
        for name, value in manager.environ.items():
            monkeypatch.setenv(name, value)

        def look(_: int) -> None:
            if manager.beats() > 2:
                node.loop.stop()

        node.loop.every(0.01, look)
        assert serve(node) == 0
        messages = manager.read()
    assert messages[0] == "READY=1"
    assert messages[-1] == "STOPPING=1"


def test_a_long_text_of_an_event_is_cut(node: Node[Shared]) -> None:
    node.event("disk_full", "error", problem="x" * 5000, folder="y" * 5000)
    (sent,) = (each.last for each in node.bus.publishers if isinstance(each.last, Event))
    assert codec.decode(codec.encode(sent), Event) == sent
    assert (len(sent.text), sent.about) == (
        MAX_TEXT,
        {"problem": "x" * MAX_TEXT, "folder": "y" * MAX_TEXT},
    )
    node.loop.close()


def test_settings_are_published_to_a_new_subscriber_and_every_ten_seconds(
    node: Node[Shared], monkeypatch: pytest.MonkeyPatch
) -> None:
    timers: list[Callable[[int], object]] = []
    monkeypatch.setattr(node.loop, "every", lambda _, handler: timers.append(handler))
    node.announce()
    (publisher,) = (each for each in node.bus.publishers if each.topic is keys.SETTINGS)
    sent: list[int] = []
    for second, is_subscribed in enumerate([False] * 3 + [True] * 25 + [False] + [True] * 2):
        before = publisher.last
        monkeypatch.setattr(Publisher, "passed_on", is_subscribed)
        for timer in timers:
            timer((1000 + second) * NS_PER_S)
        sent += [second] if publisher.last is not before else []
    assert sent == [3, 13, 23, 29]
    node.loop.close()


def test_a_long_origin_of_a_setting_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    given = ["bus.connect=tcp/127.0.0.1:1", "robot.id=" + " " * MAX_TEXT + "001"]
    node = Node("teleop", load(Shared, Sources(environ={}, sets=given)))
    timers: list[Callable[[int], object]] = []
    monkeypatch.setattr(node.loop, "every", lambda _, handler: timers.append(handler))
    monkeypatch.setattr(Publisher, "passed_on", True)
    node.announce()
    for timer in timers:
        timer(0)
    (sent,) = (each.last for each in node.bus.publishers if isinstance(each.last, Settings))
    assert codec.decode(codec.encode(sent), Settings).settings["robot.id"].value == "001"
    node.loop.close()


def test_zenoh_has_a_thread_for_each_session(
    node: Node[Shared], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A dead TCP link occupies its thread for 10 s: the others must not share it."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    node.open_bus()
    node.open_drive(listens=False)
    node.open()
    node.close()
    assert os.environ[RUNTIME_ENV] == ONE_POOL.format(links=3)
