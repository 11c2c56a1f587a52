"""However the bridge ends, the board is not left with a RUN: it stops nothing by itself."""

import signal
from collections.abc import Iterator

import pytest

from common.config import Sources, load
from common.service import Node, serve
from common.wire.commands import MotionKind
from services.bridge.bridge import Bridge
from services.bridge.config import BridgeConfig
from tests.bridge.bridge_fixture import BridgeFixture
from verification.harness.fake_board import board


def test_a_second_signal_brakes_before_the_bridge_ends(bridge: BridgeFixture) -> None:
    bridge.drive()
    bridge.board.speed_mmps = 500  # it would wait for the vehicle to stand
    bridge.process.send_signal(signal.SIGINT)
    bridge.board.wait_for(MotionKind.STOP)
    bridge.process.send_signal(signal.SIGTERM)
    assert bridge.process.wait(20) == 128 + signal.SIGTERM
    bridge.board.wait_for(MotionKind.BREAK)


@pytest.fixture
def _signals() -> Iterator[None]:
    """Give the handlers back that ``serve`` replaces."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("_signals")
def test_a_bug_of_ours_leaves_a_break() -> None:
    def bug(_: int) -> None:
        made.wait_for(MotionKind.STOP)
        raise ZeroDivisionError

    with board() as made:
        sets = [
            f"board.port={made.address[1]}",
            f"board.listen_ports={made.ports}",
            "bus.connect=tcp/127.0.0.1:1",
        ]
        node = Node("bridge", load(BridgeConfig, Sources(environ={}, sets=sets)))
        bridge = Bridge(node)
        node.loop.every(1.0, bug)
        with pytest.raises(ZeroDivisionError):
            serve(node)
        made.wait_for(MotionKind.BREAK)
        bridge._sockets.close()  # the end of the process does it otherwise
