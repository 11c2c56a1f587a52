"""``t2 estop --keepalive``: a pendant in a terminal, with a real router and a fake safety."""

import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from cli.inspect.estop import described
from common import keys
from common.bus.bus import Arrival, Bus
from common.messages import EstopKeepalive, KeepaliveState
from tests.cli.inspect.tool import FakeSafety, Tool
from tests.common.bus_fixture import BusFixture
from tests.factories import safety_state
from verification.harness.waiting import PATIENCE_S, wait_until

KNOWN = KeepaliveState(source="pendant", age=0.1, alive=True, timeout=1.0)


class Safety(FakeSafety):
    """A safety service that expects a pendant."""

    def __init__(self, buses: BusFixture) -> None:
        self.received: list[Arrival[EstopKeepalive]] = []
        super().__init__(buses, self.subscribe, estop_keepalives=(KNOWN,))

    def subscribe(self, bus: Bus) -> None:
        bus.subscribe(keys.ESTOP_KEEPALIVE, self.received.append, source="*")


@pytest.fixture
def safety(buses: BusFixture) -> Safety:
    return Safety(buses)


@pytest.fixture
def pendant(buses: BusFixture, safety: Safety) -> Iterator["subprocess.Popen[str]"]:
    command = [
        sys.executable, "-m", "cli", "estop", "--keepalive", "pendant", "--robot", buses.robot,
        "--set", f"bus.connect={buses.endpoint}",
    ]  # fmt: skip
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            wait_until(lambda: len(safety.received) > 2, "signs of life")
            yield process
        finally:
            process.kill()


def test_a_described_state_is_printable() -> None:
    assert described(safety_state(text="\x1b[2J"), "pendant").endswith("  \\u001b[2J")


def test_it_echoes_the_heartbeat_and_ends_with_a_warning(
    pendant: "subprocess.Popen[str]", safety: Safety
) -> None:
    newest = safety.received[-1]
    assert newest.key.endswith("/@cmd/estop_keepalive/pendant")
    assert newest.message.echo > 100
    pendant.send_signal(signal.SIGINT)
    out, _ = pendant.communicate(timeout=PATIENCE_S)
    assert pendant.returncode == 0
    assert "alive  RUN  Driving." in out
    assert "within 1 s" in out.splitlines()[-1]
    assert not safety.stops


def test_enter_is_an_emergency_stop(pendant: "subprocess.Popen[str]", safety: Safety) -> None:
    def more() -> int:
        """Return the number of stops after more signs of life, which pause during a stop."""
        count = len(safety.received)
        wait_until(lambda: len(safety.received) > count + 3, "more signs of life")
        return len(safety.stops)

    assert pendant.stdin is not None
    pendant.stdin.write("\n")
    pendant.stdin.close()  # the end of its input is no key
    wait_until(lambda: safety.stops, "the emergency stop")
    assert more() == more()


def test_an_unexpected_name_ends_at_once(tool: Tool, safety: Safety) -> None:
    result = tool("estop", "--keepalive", "phone")
    assert result.code == 1
    assert "safety does not expect 'phone': it expects pendant" in result.err
