"""What ends, hangs or is cut off while it drives: the board is told to stop, and all comes back."""

import signal
import time
from collections.abc import Callable
from functools import partial

from common.freshness import NS_PER_S
from verification.containers.engine import docker
from verification.containers.stack_fixture import Stage, held_run_s
from verification.harness.stack import Witness
from verification.harness.support import wait_until

REST_S = 0.3  # beside the bridge's lease, as in tests/verification/harness/test_stack.py
# Docker waits 0.1 s before it starts a container again, and the guard then brakes first of all.
RESTART_S = 15.0
STILL = 0.001  # m/s

# From inside, signals reach all but the init; no right of the host's is needed for it. Each says
# when it was, by the clock that all on this host share: to get in takes Docker a while.
EVERYTHING = """
import os, time
print(time.monotonic_ns(), flush=True)
os.kill(-1, 9)
"""
SIGNAL = """
import os, pathlib, time
for entry in pathlib.Path("/proc").iterdir():
    if entry.name.isdigit() and int(entry.name) not in (1, os.getpid()):
        words = (entry / "cmdline").read_bytes().decode().split("\\0")
        if {module!r} in words:
            print(time.monotonic_ns(), flush=True)
            os.kill(int(entry.name), {number})
"""


def is_killed(service: str, stage: Stage) -> str:
    """Kill all that a container runs; it is started again, and the vehicle stands meanwhile."""
    return survived(stage, service, partial(killed, stage, service), RESTART_S)


def is_killed_alone(module: str, stage: Stage) -> str:
    """Kill one process of the bridge's container: the container stays."""
    before = stage["bridge"].began
    seen = survived(
        stage, "bridge", partial(signalled, stage, "bridge", module, signal.SIGKILL), None
    )
    assert stage["bridge"].began == before, "the container did not outlive it"
    return f"{seen}; the container stays"


def is_not_needed(service: str, stage: Stage) -> str:
    """Kill what nobody waits for: the vehicle drives on."""
    stage.wheel.push(stage.speed)
    before = stage[service].began
    killed_ns = killed(stage, service)
    wait_until(lambda: time.monotonic_ns() - killed_ns > NS_PER_S, "a second")
    assert stage.holds() == "run", stage.holds()
    stop(stage)
    wait_until(lambda: stage[service].began != before, f"{service} is started again", RESTART_S)
    stage.wait_well(service)
    return "drives on; started again, healthy"


def is_frozen(service: str, stage: Stage) -> str:
    """Pause a container: cut off from the bus, without an end that anybody could notice."""
    stage.wheel.push(stage.speed)
    container = stage[service]
    witness, paused_ns = Witness(), time.monotonic_ns()
    docker("pause", container.id)
    docker_s = (time.monotonic_ns() - paused_ns) / NS_PER_S  # within which it took hold
    try:
        took_s, allowed_s = stands(stage, paused_ns, witness, REST_S + docker_s)
    finally:
        docker("unpause", container.id)
    stage.wheel.push(stage.speed)
    stop(stage)
    return f"{told(took_s, allowed_s)}; drives again"


def laptop_is_cut_off(stage: Stage) -> str:
    """Take the router from the laptops' network: the robot's own chain does not notice."""
    stage.wheel.push(stage.speed)
    router = stage["router"]
    network = next(iter(router.about["NetworkSettings"]["Networks"]))
    witness, cut_ns = Witness(), time.monotonic_ns()
    docker("network", "disconnect", network, router.id)
    docker_s = (time.monotonic_ns() - cut_ns) / NS_PER_S
    try:
        extra_s = stage.config.safety.sources["teleop"].lease + REST_S + docker_s
        took_s, allowed_s = stands(stage, cut_ns, witness, extra_s)
        for name in ("bridge", "safety", "odom"):
            stage["safety"].run("t2", "health", name)
    finally:
        docker("network", "connect", network, router.id)
    stage.wheel.push(stage.speed)
    stop(stage)
    return f"{told(took_s, allowed_s)}; bridge, safety, odom answer meanwhile"


def hang_is_seen(stage: Stage) -> str:
    """Stop a process without ending it: its health check finds out."""
    signalled(stage, "odom", "services.odom", signal.SIGSTOP)
    try:
        wait_until(lambda: stage["odom"].health == "unhealthy", "odom is unhealthy", 120.0)
    finally:
        signalled(stage, "odom", "services.odom", signal.SIGCONT)
    stage.wait_well("odom")
    return "unhealthy while it hangs, healthy after"


def survived(stage: Stage, service: str, hurt: Callable[[], int], restart_s: float | None) -> str:
    """Hurt a service while the vehicle drives; it stands, all comes back, and it drives again."""
    stage.wheel.push(stage.speed)
    before = stage[service].began
    witness, hurt_ns = Witness(), hurt()
    extra_s = restart_s if service == "bridge" and restart_s else REST_S
    took_s, allowed_s = stands(stage, hurt_ns, witness, extra_s)
    if restart_s is not None:
        wait_until(lambda: stage[service].began != before, f"{service} is started again", restart_s)
    stage.wait_well(service)
    stage.wheel.push(stage.speed)
    stop(stage)
    return f"{told(took_s, allowed_s)}; drives again"


def stands(stage: Stage, since_ns: int, witness: Witness, extra_s: float) -> tuple[float, float]:
    """Wait until the vehicle stands; return how long it was held to move, and what is allowed."""
    wait_until(lambda: stage.holds() in ("stop", "brake"), "STOP at the board", RESTART_S)
    wait_until(lambda: abs(stage.speed()) < STILL, "the vehicle stands")
    allowed_s = stage.config.bridge.lease + extra_s + witness.stop()
    took_s = held_run_s(stage.trace(), since_ns)
    assert took_s < allowed_s, told(took_s, allowed_s)
    return took_s, allowed_s


def told(took_s: float, allowed_s: float) -> str:
    """Say how long a command to move was held."""
    return f"the board held a command to move for {took_s:.2f} s, {allowed_s:.2f} s are allowed"


def stop(stage: Stage) -> None:
    """Let go, wait until it stands, and put it back to where it began."""
    stage.wheel.linear = 0.0
    wait_until(lambda: abs(stage.speed()) < STILL, "the vehicle stands")
    stage.put_back()


def killed(stage: Stage, service: str) -> int:
    """Kill all that a container runs, but its init, which ends then; return when, in ns."""
    return int(stage[service].python(EVERYTHING, check=False).split()[0])


def signalled(stage: Stage, service: str, module: str, number: int) -> int:
    """Send a signal to the process of a container that runs a module; return when, in ns."""
    when = stage[service].python(SIGNAL.format(module=module, number=int(number)), check=False)
    assert when, f"{service} runs no {module}"
    return int(when.split()[0])
