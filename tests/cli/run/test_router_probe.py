"""``t2 router`` and its probe: readiness, watchdog, and the kill of a hung router."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh
from msgspec.structs import replace

from cli.run.router_probe import Attempts
from common.bus.session import client_config, router_at
from common.settings import BusSettings
from tests.cli.processes import PATIENCE_S, alive, wait_gone
from tests.common.systemd_manager import Manager
from verification.harness.bus import at, router_process, set_options
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

# Zenoh 1.10.2 needs a minute to match these two: longer than the deadline, but finite.
EXPLODES = "t2/v1/001/evt/dashboard/@adv/" + "**/a/" * 7 + "b"
LONG = "t2/v1/001/evt/dashboard/@adv/" + "/".join("a" * 40)
DEADLINE_S = 1.0
DETECTED_S = 2.5 * DEADLINE_S
NOISE_S = 3.0  # delay of a busy host


@pytest.fixture
def endpoint() -> str:
    return f"tcp/127.0.0.1:{free_port()}"


@pytest.fixture
def manager(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Manager]:
    with contextlib.closing(Manager(str(tmp_path / "notify"))) as made:
        for name in ("NOTIFY_SOCKET", "WATCHDOG_USEC"):
            monkeypatch.setenv(name, made.environ[name])
        yield made


def probe_of(router: "subprocess.Popen[bytes]") -> int:
    """Wait for the probe of a router and return its process id."""
    path = Path(f"/proc/{router.pid}/task/{router.pid}/children")
    return int(wait_until(lambda: path.read_text().split(), "a probe")[0])


def successor(router: "subprocess.Popen[bytes]", first: int) -> int:
    """Return the process id of the next probe; 0 while there is none or it is dead."""
    probe = probe_of(router)
    return probe if probe != first and alive(probe) else 0


def explode(endpoint: str) -> None:
    """Declare key expressions whose matching takes long."""
    with (
        zenoh.open(client_config(at(endpoint))) as reader,
        zenoh.open(client_config(at(endpoint))) as writer,
    ):
        reader.declare_subscriber(EXPLODES, lambda _: None)
        time.sleep(0.2)  # until the router has the declaration
        writer.put(LONG, b"")
        time.sleep(0.1)


# --- a router that works ------------------------------------------------------------------------


def test_ready_and_watchdog_beats_follow_answers(manager: Manager, endpoint: str) -> None:
    with router_process(endpoint, probe_deadline=DEADLINE_S) as process:
        wait_until(lambda: manager.beats() > 2, "beats")
        assert manager.messages[0] == "READY=1"
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE_S) == 0
    assert manager.read()[-1] == "STOPPING=1"


def test_the_probe_is_restarted_and_ends_with_its_router(endpoint: str) -> None:
    with router_process(endpoint) as process:
        first = probe_of(process)
        os.kill(first, signal.SIGKILL)
        second = wait_until(lambda: successor(process, first), "another probe")
        assert process.poll() is None
        process.kill()
        process.wait()
        wait_gone([second])


def _command(pid: int) -> bytes:
    return Path(f"/proc/{pid}/cmdline").read_bytes()


# --- a router that hangs ------------------------------------------------------------------------


def test_a_router_that_hangs_on_key_matching_is_killed(endpoint: str) -> None:
    with router_process(endpoint, probe_deadline=DEADLINE_S) as process:
        wait_until(lambda: b"router_probe" in _command(probe_of(process)), "its probe")
        explode(endpoint)
        assert process.wait(DETECTED_S + NOISE_S) == -signal.SIGKILL


SMALL = """
import sys
from cli.__main__ import main
from common.bus import session
session.MAX_SESSIONS = 6
sys.exit(main(sys.argv[1:]))
"""


def test_a_full_table_of_sessions_is_no_hang_and_hides_none(
    manager: Manager, endpoint: str
) -> None:
    sets = set_options(f"bus.listen={endpoint}", f"bus.probe_deadline={DEADLINE_S}")
    command = [sys.executable, "-c", SMALL, "router", *sets]
    with subprocess.Popen(command) as router, contextlib.ExitStack() as sessions:
        wait_until(lambda: manager.beats() > 0, "an answer")
        with contextlib.suppress(zenoh.ZError):
            while True:
                sessions.enter_context(zenoh.open(client_config(at(endpoint), once=True)))
        count = manager.beats()
        wait_until(lambda: router.poll() is not None or manager.beats() > count + 12, "beats")
        assert router.poll() is None
        router.send_signal(signal.SIGSTOP)
        assert router.wait(DETECTED_S + NOISE_S) == -signal.SIGKILL


YES, NO, STALLED = (True, False), (False, False), (False, True)  # answered, stalled


@pytest.mark.parametrize(
    ("attempts", "hung"),
    [
        ([NO], False),
        ([NO, NO], True),
        ([NO, YES, NO], False),
        ([NO, STALLED, NO], False),  # the stall may have been the host's, also of the first one
        ([STALLED, NO, STALLED], True),  # forgiven once
        ([STALLED, YES, STALLED, NO], False),  # an answer proves that the router works
    ],
)
def test_two_missed_attempts_in_a_row_are_a_hang(
    attempts: list[tuple[bool, bool]], hung: bool
) -> None:
    made = Attempts()
    *before, last = [made.hung(answered, stalled=stalled) for answered, stalled in attempts]
    assert not any(before)
    assert last is hung


def test_the_probe_connects_to_the_routers_own_endpoint() -> None:
    bus = BusSettings(listen=("tcp/0.0.0.0:1", "tcp/127.0.0.1:2"), connect=("tcp/127.0.0.1:3",),
              insecure=True)  # fmt: skip
    assert router_at(bus).endpoints == ("tcp/127.0.0.1:1",)
    tls = replace(bus, listen=("tls/0.0.0.0:1", "unixsock-stream//x"), ca="a", certificate="b",
                  private_key="c", members="d")  # fmt: skip
    assert router_at(tls).endpoints == ("unixsock-stream//x",)
