"""Replay of the reference recording: its raw frames yield the same messages on a real bridge.

The test compares every field of each message that is decoded from one frame. It ignores the header,
which depends on sender and time; link, switches and events, which depend on the connection and on
the bridge's state; and the first two bumper samples, because a new bridge filters three clear ones.
"""

from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from typing import Any

import msgspec
import pytest

from cli.__main__ import main
from common import keys
from common.bus.bus import Arrival, Bus
from common.loop import Loop
from common.messages import Message
from common.wire.framing import Framing, Received
from common.wire.reports import FROM_BOARD
from services.bridge.core.translate import BumperFilter
from services.recorder.reader import Reader
from tests.bridge.bridge_fixture import bridge_process
from tests.recorder.make import KEPT
from verification.harness.bus import bus_on, running
from verification.harness.fake_board import Board
from verification.harness.waiting import wait_until

STREAMS = ("velocity", "mileage", "ultrasonic", "bumper", "driver/left", "driver/right")
HEADER = Message.__struct_fields__
FIRST_CLEAR = BumperFilter.CLEAR_SAMPLES - 1


def body(message: Message) -> dict[str, Any]:
    """Return the fields of a message without its header and without poll losses."""
    fields = msgspec.structs.asdict(message)
    return {name: value for name, value in fields.items() if name not in (*HEADER, "lost")}


@cache
def recorded() -> dict[str, list[dict[str, Any]]]:
    """Return the recorded messages of each stream."""
    found: dict[str, list[dict[str, Any]]] = defaultdict(list)
    with Reader(KEPT) as reader:
        for each in reader:
            name = each.key.partition("/tel/bridge/")[2]
            if name in STREAMS:
                assert each.message is not None
                found[name].append(body(each.message))
    found["bumper"] = found["bumper"][FIRST_CLEAR:]
    return found


def test_the_recording_covers_every_stream() -> None:
    assert KEPT.stat().st_size < 300_000
    assert set(recorded()) == set(STREAMS)
    assert max(each["linear"] for each in recorded()["velocity"]) > 0.3
    assert {each["pressed"] for each in recorded()["bumper"]} == {False, True}


def test_every_raw_frame_is_valid() -> None:
    framing, frames = Framing(), 0
    with Reader(KEPT) as reader:
        for each in reader:
            raw = each.sample.raw
            if raw is not None:
                (part,) = framing.read(raw, FROM_BOARD)
                assert isinstance(part, Received)
                frames += 1
    assert frames == sum(len(each) for each in recorded().values()) + FIRST_CLEAR


@pytest.fixture
def published(endpoint: str) -> Iterator[tuple[Board, dict[str, list[dict[str, Any]]]]]:
    """A real bridge, and the messages that it publishes on each stream."""
    found: dict[str, list[dict[str, Any]]] = defaultdict(list)
    board, links = Board(), list[Message]()
    board.sock.close()  # the replay takes its port

    def take(arrival: Arrival[Any]) -> None:
        found[arrival.key.partition("/tel/bridge/")[2]].append(body(arrival.message))

    def declare(bus: Bus) -> None:
        for topic in (keys.VELOCITY, keys.MILEAGE, keys.ULTRASONIC, keys.BUMPER):
            bus.subscribe(topic, take, depth=10_000)
        bus.subscribe(keys.DRIVER, take, depth=10_000, side="*")
        bus.subscribe(keys.LINK, lambda arrival: links.append(arrival.message))

    with (
        running(Loop()) as loop,
        bus_on(endpoint, loop, declare),
        bridge_process(board, endpoint),
    ):
        wait_until(lambda: links, "a bridge on the bus")
        yield board, found


def test_replayed_frames_yield_the_same_messages(
    published: tuple[Board, dict[str, list[dict[str, Any]]]],
) -> None:
    board, found = published
    ports = f"board.listen_ports={board.ports}"
    where = ["--set", f"board.port={board.address[1]}", "--set", ports]
    assert main(["replay", str(KEPT), "--frames", "--rate", "2", *where]) == 0
    for name in STREAMS:
        wanted = recorded()[name]
        wait_until(lambda: len(found[name]) >= len(wanted), f"all of {name}")  # noqa: B023
        assert found[name] == wanted, name
