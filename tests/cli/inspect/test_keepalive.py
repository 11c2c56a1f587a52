"""``t2 estop --keepalive``: a pendant in a terminal, with a real router and a fake safety."""

import signal
import subprocess
import sys

from cli.inspect.estop import described
from common.bus.bus import Arrival, Bus
from t2 import keys
from t2.messages import Limit, Phrase
from tests.cli.inspect.tool import FakeSafety, Tool
from tests.common.bus_fixture import BusFixture
from tests.factories import limit_source, safety_state
from verification.harness.waiting import PATIENCE_S, wait_until

KNOWN = limit_source("pendant", lease=1.0, silence="latch")
LIDAR = limit_source("lidar", lease=0.5, silence="stop")


class Safety(FakeSafety):
    """A safety service that expects a pendant."""

    def __init__(self, buses: BusFixture) -> None:
        self.received: list[Arrival[Limit]] = []
        super().__init__(buses, self.subscribe, limit_sources=(KNOWN, LIDAR))

    def subscribe(self, bus: Bus) -> None:
        bus.subscribe(keys.LIMIT, self.received.append, source="*")


def test_signs_of_life_enter_and_the_end(buses: BusFixture) -> None:
    safety = Safety(buses)

    def more() -> None:
        count = len(safety.received)
        wait_until(lambda: len(safety.received) > count + 3, "more signs of life")

    command = [
        sys.executable, "-m", "cli", "estop", "--keepalive", "pendant", "--robot", buses.robot,
        "--set", f"bus.connect={buses.endpoint}",
    ]  # fmt: skip
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            more()
            newest = safety.received[-1]
            assert newest.key.endswith("/@cmd/limit/pendant")
            assert newest.message.echo > 100
            assert not safety.stops
            assert process.stdin is not None
            process.stdin.write("\n")
            process.stdin.close()  # the end of its input is no keystroke
            wait_until(lambda: safety.stops, "the emergency stop")
            more()  # they pause during a stop
            stops = len(safety.stops)
            more()
            assert len(safety.stops) == stops
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE_S) == 0
            assert process.stdout is not None
            out = process.stdout.read()
        finally:
            process.kill()
    assert "alive  RUN  Driving." in out
    assert "within 1 s" in out.splitlines()[-1]


def test_an_unexpected_name_ends_at_once(buses: BusFixture, tool: Tool) -> None:
    Safety(buses)
    for name in ("phone", "lidar"):
        result = tool("estop", "--keepalive", name)
        assert result.code == 1
        assert f"safety does not expect '{name}': it expects pendant" in result.err


def test_a_described_state_is_printable_and_in_the_readers_language() -> None:
    state = safety_state(text="Emergency stop.", phrases=(Phrase("estop"),))
    assert described(state, "pendant", "zh").endswith("  急停。")
    assert described(safety_state(text="\x1b[2J"), "pendant").endswith("  \\u001b[2J")
