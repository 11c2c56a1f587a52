"""zenoh-cli with T2's codec publishes on a key, as ``docs/inspect.md`` shows."""

import shlex
import subprocess
import sys
from pathlib import Path

import msgpack

from tests.cli.processes import PATIENCE_S
from tests.common.bus_fixture import BusFixture
from verification.harness.waiting import wait_until

PAGE = Path(__file__).parents[3] / "docs" / "inspect.md"


def test_put(buses: BusFixture) -> None:
    received: list[bytes] = []
    subscriber = buses.session().declare_subscriber(
        f"t2/v1/{buses.robot}/tel/mine/*", lambda s: received.append(s.payload.to_bytes())
    )
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    alias = next(line for line in lines if line.startswith("alias z='zenoh "))
    line = next(line for line in lines if line.startswith("z put "))
    line = line.replace("z", alias.partition("'")[2].rstrip("'"), 1)
    line = line.replace("tcp/127.0.0.1:7447", buses.endpoint).replace("/001/", f"/{buses.robot}/")
    name, *words = shlex.split(line)
    done = subprocess.run(
        [Path(sys.executable).parent / name, *words],
        capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    wait_until(lambda: received, "the message")
    message = msgpack.unpackb(received[0])
    assert (message["celsius"], message["seq"]) == (21.5, 1)
    subscriber.undeclare()
