"""The router's host is cut off: the drive link of a service goes on.

Zenoh closes a TCP link with unsent data in one of its worker threads, which takes 10 s. Other links
must not wait for it.
"""

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from common.bus.session import RUNTIME_ENV
from verification.harness.network_hosts import End, connect, ip, missing
from verification.harness.network_hosts import hosts as made

pytestmark = [pytest.mark.timed, pytest.mark.campaign]

HERE, THERE = (f"t2dead{os.getpid()}{end}" for end in ("a", "b"))
ROUTER = "tcp/10.98.0.2:7447"
PATIENCE_S = 60.0
GAP_MAX_S = 2.0  # as opposed to 10

# Receives safety's motions as the bridge does; prints the longest gap between two of them.
BRIDGE = """
import sys, time
from t2 import keys
from common.bus.bus import Bus
from common.bus.drive import DriveLink
from common.loop import Loop
from common.settings import BusSettings

loop, gaps, came = Loop(), [], [0.0]

def on_motion(_):
    now = time.monotonic()
    gaps.append(now - came[0])
    came[0] = now
    if len(gaps) == 50:
        print("driving", flush=True)

def on_second(_):
    if sys.stdin in __import__("select").select([sys.stdin], [], [], 0)[0]:
        print(max([*gaps[50:], time.monotonic() - came[0]]), flush=True)
        loop.stop()

bus = Bus(BusSettings(connect=(sys.argv[1],), drive=sys.argv[2]), "001", loop.post)
link = DriveLink(bus, listens=True)
link.subscribe(keys.MOTION, on_motion, depth=64)
loop.every(0.1, on_second)
bus.open()
loop.run()
bus.close()
loop.close()
"""


WHY = missing(HERE)


@pytest.fixture
def hosts() -> Iterator[None]:
    """Two hosts and a cable."""
    with made(HERE, THERE):
        connect(End(HERE, "end", ("10.98.0.1",)), End(THERE, "end", ("10.98.0.2",)))
        yield


@contextlib.contextmanager
def program(host: str, *words: str) -> Iterator["subprocess.Popen[str]"]:
    command = ["ip", "netns", "exec", host, sys.executable, *words]
    environ = {name: value for name, value in os.environ.items() if name != RUNTIME_ENV}
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environ
    ) as process:
        try:
            yield process
        finally:
            process.kill()


@pytest.mark.skipif(bool(WHY), reason=WHY or "-")
def test_the_drive_link_goes_on(hosts: None, tmp_path: Path) -> None:
    tmp_path.chmod(0o700)
    drive = f"unixsock-stream/{tmp_path}/d.sock"
    sets = ["--set", f"bus.connect={ROUTER}", "--set", f"bus.drive={drive}"]
    insecure = ["--set", f"bus.listen={ROUTER}", "--insecure"]
    with (
        program(THERE, "-m", "cli", "router", *insecure),
        program(HERE, "-c", BRIDGE, ROUTER, drive) as bridge,
        program(HERE, "-m", "services.safety", *sets),
        # What it gets is unsent when the cable is cut.
        program(THERE, "-m", "cli", "echo", "**", "--set", f"bus.connect={ROUTER}"),
    ):
        assert bridge.stdout is not None
        assert bridge.stdout.readline() == "driving\n"
        subprocess.run(["sleep", "3"], check=True)  # all sessions are open
        ip("-n", HERE, "link", "set", "end", "down")
        subprocess.run(["sleep", "8"], check=True)
        out, _ = bridge.communicate("\n", timeout=PATIENCE_S)
    assert json.loads(out) < GAP_MAX_S
