"""Streams: the newest message, and never a backlog."""

import threading
import time
from collections.abc import Iterator

import msgspec
import pytest
import zenoh

import t2
from common.bus.session import client_config
from t2.connection import LOCAL, settings
from t2.messages import Odometry, Velocity
from verification.harness.bus import at
from verification.harness.waiting import wait_until

KEY = "t2/v1/001/tel/bridge/velocity"


class Robot:
    """A client, and the bridge's publisher of velocities."""

    def __init__(self, endpoint: str) -> None:
        self.client = t2.connect("001", endpoint=endpoint)
        self._session = zenoh.open(client_config(at(endpoint)))
        self._publisher = self._session.declare_publisher(KEY)

    def put(self, linear: float) -> None:
        self._publisher.put(msgspec.msgpack.encode(Velocity(linear=linear, angular=0.0)))

    def put_raw(self, payload: bytes) -> None:
        self._publisher.put(payload)

    def close(self) -> None:
        self.client.close()
        self._session.close()


@pytest.fixture
def robot(endpoint: str) -> Iterator[Robot]:
    it = Robot(endpoint)
    yield it
    it.close()


def received(robot: Robot, linear: float) -> bool:
    """Publish until it is received."""
    robot.put(linear)
    newest = robot.client.velocity.newest
    return newest is not None and newest.linear == linear


def test_the_newest_is_kept_with_its_age(robot: Robot) -> None:
    stream = robot.client.velocity
    assert (stream.newest, stream.age) == (None, float("inf"))
    stream.open()
    wait_until(lambda: received(robot, 0.5), "a velocity")
    assert stream.latest().linear == 0.5
    assert stream.age < 10.0


def test_without_a_message_the_error_names_key_and_remedy(robot: Robot) -> None:
    with pytest.raises(t2.NoData, match=rf"no velocity within 0\.1 s on {KEY}.*t2 doctor"):
        robot.client.velocity.latest(timeout=0.1)


def test_a_slow_reader_gets_the_newest_only(robot: Robot) -> None:
    stream = robot.client.velocity
    messages = iter(stream)
    wait_until(lambda: received(robot, 0.0), "a velocity")
    for number in range(1, 20):
        robot.put(float(number))
    wait_until(lambda: stream.newest and stream.newest.linear == 19.0, "the last one")
    assert next(messages).linear == 19.0


def test_a_handler_that_fails_is_called_again(
    robot: Robot, caplog: pytest.LogCaptureFixture
) -> None:
    seen: list[float] = []

    def handle(velocity: Velocity) -> None:
        seen.append(velocity.linear)
        if len(seen) == 1:
            raise ValueError("the first one")

    robot.client.velocity.on(handle)

    def twice() -> bool:
        robot.put(time.monotonic())
        return len(seen) >= 2

    wait_until(twice, "two messages")
    assert "the first one" in caplog.text


def test_a_message_of_another_type_is_counted(robot: Robot) -> None:
    stream = robot.client.velocity
    stream.open()
    wait_until(lambda: received(robot, 0.1), "a velocity")
    robot.put_raw(b"\xc1")
    wait_until(lambda: stream.invalid == 1, "the count")
    assert stream.latest(timeout=60.0).linear == 0.1


def test_the_end_of_one_iteration_leaves_the_others(robot: Robot) -> None:
    stream = robot.client.velocity
    kept, ended = iter(stream), iter(stream)
    wait_until(lambda: received(robot, 0.5), "a velocity")
    assert next(ended).linear == next(kept).linear
    ended.close()  # type: ignore[attr-defined]
    wait_until(lambda: received(robot, 0.7), "another velocity")
    assert next(kept).linear in (0.5, 0.7)


def test_closing_ends_an_iteration(robot: Robot) -> None:
    ended = threading.Event()

    def read() -> None:
        for _ in robot.client.velocity:
            pass
        ended.set()

    threading.Thread(target=read, daemon=True).start()
    robot.client.close()
    assert ended.wait(10)


def test_without_a_router_the_error_names_the_endpoint() -> None:
    with pytest.raises(t2.LinkError, match=r"no router answers at tcp/127\.0\.0\.1:1: .*t2 doctor"):
        t2.connect("001", endpoint="tcp/127.0.0.1:1")


@pytest.mark.parametrize("name", ["", "*", "001/**"])
def test_an_id_of_several_robots_is_refused(name: str) -> None:
    with pytest.raises(t2.LinkError, match="not the id of one robot"):
        t2.connect(name)


def test_tls_files_go_into_the_settings_of_zenoh() -> None:
    made = settings([LOCAL], {"ca": "ca.pem", "certificate": "c.pem", "private_key": "p.key"})
    assert made["transport"]["link"]["tls"] == {
        "root_ca_certificate": "ca.pem", "connect_certificate": "c.pem",
        "connect_private_key": "p.key", "enable_mtls": True,
    }  # fmt: skip
    assert "link" not in settings([LOCAL], {})["transport"]


def test_a_message_type_is_that_of_the_stack() -> None:
    assert "pose_covariance" in Odometry.__struct_fields__
