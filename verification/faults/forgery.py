"""Forged messages of bridge and safety, from a plain client of the router."""

import os
import signal
import time
from collections.abc import Callable

import zenoh
from msgspec.structs import replace

from common import clock, codec, keys
from common.bus.session import client_config
from common.messages import Bumper, Motion, Velocity
from common.motion import Command
from verification.faults import injectors
from verification.faults.stack_fixture import StackFixture
from verification.harness.bus import at
from verification.harness.waiting import becomes_true

LASTS_S = 0.6
AHEAD = 1000
BACKWARD_MPS = -0.5  # no driver of the campaign requests it
LOST_S = 2.0  # twice the lease of a session
HUNG_S = 0.05  # the vehicle still moves: the lease is 0.2 s


def forged(make: Callable[[Motion, Bumper], dict[str, bytes]]) -> Callable[[StackFixture], int]:
    """Publish forgeries of the newest motion and bumper sample, at 50 Hz for ``LASTS_S``."""

    def inject(fixture: StackFixture) -> int:
        newest: dict[str, bytes] = {}
        motion, bumper = keys.MOTION.on("001"), keys.BUMPER.on("001")

        def take(sample: zenoh.Sample) -> None:
            newest[str(sample.key_expr)] = sample.payload.to_bytes()

        with zenoh.open(client_config(at(fixture.running.endpoint))) as session:
            subscribers = [session.declare_subscriber(key, take) for key in (motion, bumper)]
            becomes_true(lambda: len(newest) == len(subscribers), 2.0)
            command = codec.decode(newest[motion], Motion)
            sample = codec.decode(newest[bumper], Bumper)
            at_ns = clock.now_ns()
            while clock.now_ns() - at_ns < LASTS_S * 1e9:
                command = replace(command, seq=command.seq + AHEAD)
                sample = replace(sample, seq=sample.seq + AHEAD)
                for key, payload in make(command, sample).items():
                    session.put(key, payload)
                time.sleep(0.02)
            for subscriber in subscribers:
                subscriber.undeclare()
        return at_ns

    return inject


def authority(motion: Motion, _: Bumper) -> dict[str, bytes]:
    """Forge a motion command of safety."""
    run = replace(motion, command=Command.RUN, linear=BACKWARD_MPS)
    return {keys.MOTION.on("001"): codec.encode(run)}


def lock_out(motion: Motion, _: Bumper) -> dict[str, bytes]:
    """Forge a motion with a sequence number above all that safety will use."""
    return {keys.MOTION.on("001"): codec.encode(replace(motion, seq=2**62))}


def measurements(_: Motion, bumper: Bumper) -> dict[str, bytes]:
    """Forge a contact and a runaway velocity of the bridge."""
    velocity = Velocity(linear=3.0, angular=0.0, seq=bumper.seq, boot=bumper.boot)
    return {
        keys.BUMPER.on("001"): codec.encode(replace(bumper, pressed=True)),
        keys.VELOCITY.on("001"): codec.encode(velocity),
    }


def hit_while_safety_hangs(fixture: StackFixture) -> int:
    """Send SIGSTOP to safety, and press the bumper while the vehicle still moves."""
    os.kill(injectors.pid_of(fixture, "safety"), signal.SIGSTOP)
    time.sleep(HUNG_S)
    return injectors.hit(0.3)(fixture)


def estop_while_safety_hangs(fixture: StackFixture) -> int:
    """Send SIGSTOP to safety for longer than its session lasts, and one emergency stop."""
    os.kill(injectors.pid_of(fixture, "safety"), signal.SIGSTOP)
    time.sleep(LOST_S)
    return injectors.estop(fixture)
