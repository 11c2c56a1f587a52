"""The kept recording: its raw frames, played to a real bridge, make the same messages again.

What is compared: every field of every message that is made of one frame. What is not: the header,
which is of the sender and the moment; link, switches and events, which tell of the way to the board
and of the bridge's own doing; and the first two samples of the bumper, because a bridge that has
just started takes three clear ones for one.
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
from services.bridge.translate import BumperFilter
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
    """Return a message without its header, and without what depends on when polls were sent."""
    fields = msgspec.structs.asdict(message)
    return {name: value for name, value in fields.items() if name not in (*HEADER, "lost")}


@cache
def recorded() -> dict[str, list[dict[str, Any]]]:
    """Return what was recorded of each stream."""
    found: dict[str, list[dict[str, Any]]] = defaultdict(list)
    with Reader(KEPT) as reader:
        for each in reader:
            name = each.key.partition("/tel/bridge/")[2]
            if name in STREAMS:
                assert each.message is not None
                found[name].append(body(each.message))
    found["bumper"] = found["bumper"][FIRST_CLEAR:]
    return found


def test_it_is_worth_playing() -> None:
    assert KEPT.stat().st_size < 300_000
    assert set(recorded()) == set(STREAMS)
    assert max(each["linear"] for each in recorded()["velocity"]) > 0.3
    assert {each["pressed"] for each in recorded()["bumper"]} == {False, True}


def test_every_frame_is_one_of_the_board_s() -> None:
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
def heard(endpoint: str) -> Iterator[tuple[Board, dict[str, list[dict[str, Any]]]]]:
    """A real bridge, and what it says of each stream."""
    found: dict[str, list[dict[str, Any]]] = defaultdict(list)
    board, links = Board(), list[Message]()
    board.sock.close()  # its place is the replay's

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


def test_the_frames_make_the_same_messages(
    heard: tuple[Board, dict[str, list[dict[str, Any]]]],
) -> None:
    board, found = heard
    ports = f"board.listen_ports={board.ports}"
    where = ["--set", f"board.port={board.address[1]}", "--set", ports]
    assert main(["replay", str(KEPT), "--frames", "--rate", "2", *where]) == 0
    for name in STREAMS:
        wanted = recorded()[name]
        wait_until(lambda: len(found[name]) >= len(wanted), f"all of {name}")  # noqa: B023
        assert found[name] == wanted, name
