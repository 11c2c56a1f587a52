"""Streams: the newest message, and never a backlog."""

import threading
import time
from collections.abc import AsyncIterator, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh

import t2
from common.bus.session import client_config
from t2.connection import ENDPOINT, LOCAL, settings
from t2.messages import Velocity
from verification.harness.bus import at
from verification.harness.waiting import wait_until

KEY = "t2/v1/001/tel/bridge/velocity"


class Robot:
    """A client, and the bridge's publisher of velocities."""

    def __init__(self, endpoint: str) -> None:
        self.client = t2.connect("001", endpoint=endpoint)
        self.stream = self.client.velocity
        self._session = zenoh.open(client_config(at(endpoint)))
        self._publisher = self._session.declare_publisher(KEY)

    def put(self, linear: float) -> None:
        self.put_raw(msgspec.msgpack.encode(Velocity(linear=linear, angular=0.0)))

    def put_raw(self, payload: bytes) -> None:
        self._publisher.put(payload)

    def put_health(self, payload: bytes) -> None:
        self._session.put("t2/v1/001/tel/safety/health", payload)

    def put_until_received(self, linear: float) -> None:
        def received() -> bool:
            self.put(linear)
            return self.stream.newest is not None and self.stream.newest.linear == linear

        self.stream.open()
        wait_until(received, "a velocity")

    def close(self) -> None:
        self.client.close()
        self._session.close()


@pytest.fixture
def robot(endpoint: str) -> Iterator[Robot]:
    it = Robot(endpoint)
    yield it
    it.close()


def test_the_newest_is_kept_with_its_age_and_others_are_counted(robot: Robot) -> None:
    stream = robot.stream
    assert (stream.newest, stream.age) == (None, float("inf"))
    with pytest.raises(t2.NoData, match=rf"no velocity within 0\.1 s on {KEY}.*t2 doctor"):
        stream.latest(timeout=0.1)
    robot.put_until_received(0.5)
    robot.put_raw(b"\xc1")
    wait_until(lambda: stream.invalid == 1, "the count")
    assert stream.latest(timeout=60.0).linear == 0.5
    assert stream.age < 60.0


@pytest.mark.parametrize(
    ("version", "error", "text"),
    [
        (
            "0.0.9",
            t2.Incompatible,
            rf"incompatible \(stack 0\.0\.9, this package {t2.__version__}\)",
        ),
        (t2.__version__, t2.NoData, "a foreign program may send them"),
    ],
)
def test_messages_of_another_version_are_named(
    robot: Robot,
    caplog: pytest.LogCaptureFixture,
    version: str,
    error: type[t2.T2Error],
    text: str,
) -> None:
    health = msgspec.msgpack.encode({"version": version, "of_a_later_version": 1})
    ended = threading.Event()

    def publish() -> None:
        while not ended.wait(0.05):
            robot.put_raw(msgspec.msgpack.encode({"speed": 1.0}))
            robot.put_health(health)

    publishing = threading.Thread(target=publish)
    publishing.start()
    try:
        wait_until(lambda: robot.client.version == version, "the version")
        robot.stream.open()
        wait_until(lambda: robot.stream.invalid > 2, "the messages")
        with pytest.raises(error, match=text):
            robot.stream.latest(timeout=1.0)
        assert caplog.text.count(": not a Velocity: ") == 1
    finally:
        ended.set()
        publishing.join()


def test_a_slow_reader_gets_the_newest_only_whatever_others_read(robot: Robot) -> None:
    with robot.stream.reading() as kept:
        with robot.stream.reading() as ended:
            robot.put_until_received(0.0)
            assert robot.stream.after(ended, 20.0) is not None
        for number in range(1, 20):
            robot.put(float(number))
        wait_until(lambda: robot.stream.latest().linear == 19.0, "the last one")
        newest = robot.stream.after(kept, 20.0)
        assert newest is not None
        assert newest.linear == 19.0
        assert robot.stream.dropped >= 19


def test_a_handler_that_fails_is_called_again_until_the_robot_closes(
    robot: Robot, caplog: pytest.LogCaptureFixture
) -> None:
    seen: list[float] = []

    def handle(velocity: Velocity) -> None:
        seen.append(velocity.linear)
        if len(seen) == 1:
            raise ValueError("the first one")

    robot.stream.on(handle)
    (thread,) = (each for each in threading.enumerate() if each.name == f"t2 {KEY}")

    def twice() -> bool:
        robot.put(time.monotonic())
        return len(seen) >= 2

    wait_until(twice, "two messages")
    assert "the first one" in caplog.text
    robot.client.close()
    thread.join(10)
    assert not thread.is_alive()


async def coroutine(_: Velocity, __: int = 0) -> None: ...


async def generator(_: Velocity) -> AsyncIterator[int]:
    yield 1


class Callables:
    async def __call__(self, _: Velocity) -> None: ...

    async def method(self, _: Velocity) -> None: ...


@pytest.mark.parametrize(
    "handle",
    [
        coroutine, partial(coroutine, __=1), partial(partial(coroutine)), generator, Callables(),
        partial(Callables()), Callables().method, None, "print",
    ],
)  # fmt: skip
def test_what_must_be_awaited_is_no_handler(robot: Robot, handle: Any) -> None:
    for stream in (robot.stream, t2.AsyncStream(robot.stream)):
        with pytest.raises(TypeError, match=r"is no function|coroutine function"):
            stream.on(handle)


def test_a_handler_that_returns_a_coroutine_is_logged(
    robot: Robot, caplog: pytest.LogCaptureFixture
) -> None:
    robot.stream.on(lambda velocity: coroutine(velocity))
    robot.put_until_received(1.0)
    wait_until(lambda: "which nobody awaits" in caplog.text, "the log")


def test_a_handler_gets_a_message_that_comes_before_its_thread(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Velocity] = []
    start = threading.Thread.start

    def start_late(thread: threading.Thread) -> None:
        if thread.name.startswith("t2 "):  # Zenoh has threads, too
            robot.put_until_received(1.0)
        start(thread)

    monkeypatch.setattr(threading.Thread, "start", start_late)
    robot.stream.on(seen.append)
    wait_until(lambda: seen, "the message")


def test_a_closed_subscription_calls_no_more(robot: Robot) -> None:
    closed: list[float] = []
    other: list[float] = []
    with (
        robot.stream.on(lambda velocity: closed.append(velocity.linear)) as subscription,
        robot.stream.on(lambda velocity: other.append(velocity.linear)),
    ):
        robot.put_until_received(1.0)
        wait_until(lambda: closed and other, "both calls")
        subscription.close()
        robot.put_until_received(2.0)
        wait_until(lambda: 2.0 in other, "the other call")
    assert set(closed) == {1.0}


@pytest.mark.parametrize("name", ["*", "001/**"])
def test_an_id_of_several_robots_is_refused(name: str) -> None:
    with pytest.raises(t2.LinkError, match="not the id of one robot"):
        t2.connect(name)


def test_an_id_may_be_left_out_with_one_robot(endpoint: str) -> None:
    with zenoh.open(client_config(at(endpoint))) as session:
        with pytest.raises(t2.LinkError, match="has no robot: name one"):
            t2.connect(endpoint=endpoint)
        others = ("999/live/dashboard/1", "998/live/teleop/1", "997/live/recorder/1", "996/live/x")
        tokens = [session.liveliness().declare_token(f"t2/v1/{each}") for each in others]
        assert t2.robots(endpoint) == []
        tokens.append(session.liveliness().declare_token("t2/v1/007/live/bridge/1"))
        wait_until(lambda: t2.robots(endpoint) == ["007"], "the robot")
        with t2.connect(endpoint=endpoint) as robot:
            assert robot.name == "007"
        tokens.append(session.liveliness().declare_token("t2/v1/008/live/bridge/1"))
        wait_until(lambda: t2.robots(endpoint) == ["007", "008"], "both robots")
        with pytest.raises(t2.LinkError, match="has the robots 007, 008: name one"):
            t2.connect(endpoint=endpoint)


@pytest.mark.parametrize(
    "endpoint",
    ["robot:7447", "tcp/robot", "udp/robot:7447", "http://robot:7447", "tcp/tls/robot:7447"],
)
def test_what_is_no_endpoint_is_refused(endpoint: str) -> None:
    with pytest.raises(t2.LinkError, match=r"is no endpoint, such as tcp/127\.0\.0\.1:7447"):
        t2.connect("001", endpoint=endpoint)


@pytest.mark.parametrize(
    "endpoint", ["tcp/[::1]:7447", "tls/robot:7447#iface=eth0", "unixsock-stream//run/t2/bus.sock"]
)
def test_the_endpoints_of_zenoh_are_known(endpoint: str) -> None:
    assert ENDPOINT.fullmatch(endpoint)


def test_the_reason_of_zenoh_is_kept() -> None:
    with pytest.raises(t2.LinkError, match=r"Zenoh: [^/]*\[.*127\.0\.0\.1:9.*\]") as refused:
        t2.connect("001", endpoint="tcp/127.0.0.1:9")
    assert "/zenoh/src/" not in str(refused.value)


def test_tls_files_go_into_the_settings_of_zenoh() -> None:
    made = settings([LOCAL], {"ca": "ca.pem", "certificate": "c.pem", "private_key": "p.key"})
    assert made["transport"]["link"]["tls"] == {
        "root_ca_certificate": "ca.pem", "connect_certificate": "c.pem",
        "connect_private_key": "p.key", "enable_mtls": True,
    }  # fmt: skip
    plain = settings([LOCAL], {})["transport"]["link"]
    assert plain == {"rx": {"max_message_size": 8 * 2**20}}
    assert made["transport"]["link"]["rx"] == plain["rx"]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_settings_of_any_editor_and_an_encrypted_key(
    tmp_path: Path, encoding: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "key.pem").write_text("-----BEGIN ENCRYPTED PRIVATE KEY-----\n", encoding="ascii")
    text = '[bus]\r\nconnect = ["tls/robot:7447"]\r\nprivate_key = "~/key.pem"\r\n'
    (tmp_path / "bus.toml").write_bytes(text.encode(encoding))
    with pytest.raises(t2.LinkError, match=rf"private_key {tmp_path}/key.pem: is encrypted"):
        t2.connect("001", config="~/bus.toml")
