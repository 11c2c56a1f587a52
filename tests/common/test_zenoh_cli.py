"""The installed ``zenoh`` command with our codec, against a real router."""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from common import keys
from common.bus.bus import Arrival
from common.messages import Bumper, Drive
from tests.common.bus_fixture import BusFixture, until_received
from verification.harness.waiting import PATIENCE_S, wait_until

ZENOH = Path(sys.executable).parent / "zenoh"


def command(buses: BusFixture, *words: str) -> list[str]:
    """Return the command line that docs and README give."""
    options = ("--mode", "client", "--connect", buses.endpoint)
    return [str(ZENOH), *options, "--cfg", "scouting/multicast/enabled:false", *words]


def zenoh(buses: BusFixture, *words: str) -> "subprocess.CompletedProcess[str]":
    """Run the command to its end."""
    return subprocess.run(
        command(buses, *words), capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )


@pytest.fixture
def watching(buses: BusFixture) -> Iterator["subprocess.Popen[str]"]:
    words = ("subscribe", "-k", f"t2/v1/{buses.robot}/**", "--decoder", "t2")
    with subprocess.Popen(
        command(buses, *words, "--line", "{key}: {value}"), stdout=subprocess.PIPE, text=True,
        env={"PYTHONUNBUFFERED": "1"},
    ) as process:  # fmt: skip
        try:
            yield process
        finally:
            process.kill()


def test_it_shows_our_messages(buses: BusFixture, watching: "subprocess.Popen[str]") -> None:
    bus = buses.bus()
    publisher = bus.publisher(keys.BUMPER)
    # Samples put before the subscription are lost; a match confirms the subscription.
    until_received(
        lambda: publisher.put(Bumper(pressed=True)),
        lambda: publisher.passed_on,
        "the subscription",
    )
    publisher.put(Bumper(pressed=True))
    assert watching.stdout is not None
    line = watching.stdout.readline()
    found = re.fullmatch(r"(\S+): (\{.*\})\n", line)
    assert found, line
    assert found[1] == keys.BUMPER.on(buses.robot)
    shown = json.loads(found[2])
    assert shown["pressed"] is True
    assert shown["boot"] == bus.boot


def test_it_puts_a_message_that_we_understand(buses: BusFixture) -> None:
    received: list[Arrival[Drive]] = []
    buses.bus(lambda bus: bus.subscribe(keys.DRIVE, received.append, source="*"))
    key = keys.DRIVE.on(buses.robot, source="web")
    text = '{"linear": 0.25, "angular": 0, "echo": 1}'
    done = zenoh(buses, "put", "-k", key, "--encoder", "t2", "-v", text)
    assert done.returncode == 0, done.stderr
    wait_until(lambda: received, "the message")
    message = received[0].message
    assert (message.linear, message.echo, message.seq) == (0.25, 1, 1)
    assert message.boot != 0
