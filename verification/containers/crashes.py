"""Killed, hanging and disconnected services while driving: STOP in time, and recovery."""

import signal
from collections.abc import Callable
from functools import partial

from common import clock
from common.freshness import NS_PER_S
from verification.containers.engine import docker
from verification.containers.stack_fixture import StackFixture, held_run_s
from verification.harness.host import StallRecorder
from verification.harness.waiting import wait_until

REST_S = 0.3  # in addition to the bridge's lease, as in tests/verification/harness/test_stack.py
# Docker waits 0.1 s before it restarts a container; the guard then brakes at first.
RESTART_S = 15.0
STILL = 0.001  # m/s

# Inside a container a signal reaches all processes except init, without rights on the host. Each
# script prints its time by the host's monotonic clock, because `docker exec` takes some time.
KILL_ALL = """
import os, time
print(time.clock_gettime_ns(time.CLOCK_BOOTTIME), flush=True)
os.kill(-1, 9)
"""
SIGNAL = """
import os, pathlib, time
for entry in pathlib.Path("/proc").iterdir():
    if entry.name.isdigit() and int(entry.name) not in (1, os.getpid()):
        words = (entry / "cmdline").read_bytes().decode().split("\\0")
        if {module!r} in words:
            print(time.clock_gettime_ns(time.CLOCK_BOOTTIME), flush=True)
            os.kill(int(entry.name), {number})
"""


def container_is_killed(service: str, fixture: StackFixture) -> str:
    """Kill all processes of a container; Docker restarts it, the vehicle stops meanwhile."""
    return recovers(fixture, service, partial(kill_all, fixture, service), RESTART_S)


def process_is_killed(module: str, fixture: StackFixture) -> str:
    """Kill one process of the bridge's container; the container keeps running."""
    before = fixture["bridge"].began
    seen = recovers(
        fixture, "bridge", partial(send_signal, fixture, "bridge", module, signal.SIGKILL), None
    )
    assert fixture["bridge"].began == before, "the container ended with it"
    return f"{seen}; the container keeps running"


def optional_container_is_killed(service: str, fixture: StackFixture) -> str:
    """Kill a service that driving does not need; the vehicle drives on."""
    fixture.driver.push(fixture.speed)
    before = fixture[service].began
    killed_ns = kill_all(fixture, service)
    wait_until(lambda: clock.now_ns() - killed_ns > NS_PER_S, "a second")
    assert fixture.holds() == "run", fixture.holds()
    stop(fixture)
    wait_until(lambda: fixture[service].began != before, f"{service} is restarted", RESTART_S)
    fixture.wait_healthy(service)
    return "drives on; restarted, healthy"


def container_is_paused(service: str, fixture: StackFixture) -> str:
    """Pause a container: it disappears from the bus without closing a connection."""
    fixture.driver.push(fixture.speed)
    container = fixture[service]
    stalls, paused_ns = StallRecorder(), clock.now_ns()
    docker("pause", container.id)
    docker_s = (clock.now_ns() - paused_ns) / NS_PER_S  # the pause began within this time
    try:
        took_s, allowed_s = stands(fixture, paused_ns, stalls, REST_S + docker_s)
    finally:
        docker("unpause", container.id)
    fixture.driver.push(fixture.speed)
    stop(fixture)
    return f"{held(took_s, allowed_s)}; drives again"


def laptop_network_is_cut(fixture: StackFixture) -> str:
    """Disconnect the router from the laptops' network; services on board are not affected."""
    fixture.driver.push(fixture.speed)
    router = fixture["router"]
    network = next(iter(router.about["NetworkSettings"]["Networks"]))
    stalls, cut_ns = StallRecorder(), clock.now_ns()
    docker("network", "disconnect", network, router.id)
    docker_s = (clock.now_ns() - cut_ns) / NS_PER_S
    try:
        extra_s = fixture.config.safety.sources["teleop"].lease + REST_S + docker_s
        took_s, allowed_s = stands(fixture, cut_ns, stalls, extra_s)
        for name in ("bridge", "safety", "odom"):
            fixture["safety"].run("t2", "health", name)
    finally:
        docker("network", "connect", network, router.id)
    fixture.driver.push(fixture.speed)
    stop(fixture)
    return f"{held(took_s, allowed_s)}; bridge, safety, odom answer meanwhile"


def hang_is_detected(fixture: StackFixture) -> str:
    """Send SIGSTOP to a process; its health check detects it."""
    send_signal(fixture, "odom", "services.odom", signal.SIGSTOP)
    try:
        wait_until(lambda: fixture["odom"].health == "unhealthy", "odom is unhealthy", 120.0)
    finally:
        send_signal(fixture, "odom", "services.odom", signal.SIGCONT)
    fixture.wait_healthy("odom")
    return "unhealthy while it hangs, healthy after"


def recovers(
    fixture: StackFixture, service: str, inject: Callable[[], int], restart_s: float | None
) -> str:
    """Inject a fault while driving; the vehicle stops, the service recovers, driving resumes."""
    fixture.driver.push(fixture.speed)
    before = fixture[service].began
    stalls, fault_ns = StallRecorder(), inject()
    extra_s = restart_s if service == "bridge" and restart_s else REST_S
    took_s, allowed_s = stands(fixture, fault_ns, stalls, extra_s)
    if restart_s is not None:
        wait_until(lambda: fixture[service].began != before, f"{service} is restarted", restart_s)
    fixture.wait_healthy(service)
    fixture.driver.push(fixture.speed)
    stop(fixture)
    return f"{held(took_s, allowed_s)}; drives again"


def stands(
    fixture: StackFixture, since_ns: int, stalls: StallRecorder, extra_s: float
) -> tuple[float, float]:
    """Wait until the vehicle stands; return how long it held a moving command, and the limit."""
    wait_until(lambda: fixture.holds() in ("stop", "brake"), "STOP at the board", RESTART_S)
    wait_until(lambda: abs(fixture.speed()) < STILL, "the vehicle stands")
    allowed_s = fixture.config.bridge.lease + extra_s + stalls.stop()
    took_s = held_run_s(fixture.trace(), since_ns)
    assert took_s < allowed_s, held(took_s, allowed_s)
    return took_s, allowed_s


def held(took_s: float, allowed_s: float) -> str:
    """Describe how long the board held a moving command."""
    return f"the board held a moving command for {took_s:.2f} s, limit {allowed_s:.2f} s"


def stop(fixture: StackFixture) -> None:
    """Request zero, wait until the vehicle stands, and put it back to its start."""
    fixture.driver.linear = 0.0
    wait_until(lambda: abs(fixture.speed()) < STILL, "the vehicle stands")
    fixture.put_back()


def kill_all(fixture: StackFixture, service: str) -> int:
    """Kill all processes of a container except init, which then ends; return the time in ns."""
    return int(fixture[service].python(KILL_ALL, check=False).split()[0])


def send_signal(fixture: StackFixture, service: str, module: str, number: int) -> int:
    """Send a signal to the process of a container that runs a module; return the time in ns."""
    when = fixture[service].python(SIGNAL.format(module=module, number=int(number)), check=False)
    assert when, f"{service} runs no {module}"
    return int(when.split()[0])
