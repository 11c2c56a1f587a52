"""Messages in the name of bridge and safety, from a plain client of the router."""

import os
import signal
import time
from collections.abc import Callable

import zenoh
from msgspec.structs import replace

from common import codec, keys
from common.bus.session import client_config
from common.messages import Bumper, Motion, Velocity
from common.motion import Command
from verification.faults import injectors
from verification.faults.stack_fixture import Lane, until
from verification.harness.support import at

LASTS_S = 0.6
AHEAD = 1000
BACKWARD_MPS = -0.5  # no driver of the campaign asks for that
HUNG_S = 0.05  # the vehicle still moves: the lease is 0.2 s


def forged(make: Callable[[Motion, Bumper], dict[str, bytes]]) -> Callable[[Lane], int]:
    """Put what is made of the newest motion and bumper sample, at 50 Hz for a while."""

    def inject(lane: Lane) -> int:
        newest: dict[str, bytes] = {}
        motion, bumper = keys.MOTION.on("001"), keys.BUMPER.on("001")

        def take(sample: zenoh.Sample) -> None:
            newest[str(sample.key_expr)] = sample.payload.to_bytes()

        with zenoh.open(client_config(at(lane.stack.endpoint))) as session:
            subscribers = [session.declare_subscriber(key, take) for key in (motion, bumper)]
            until(lambda: len(newest) == len(subscribers), 2.0)
            command = codec.decode(newest[motion], Motion)
            sample = codec.decode(newest[bumper], Bumper)
            at_ns = time.monotonic_ns()
            while time.monotonic_ns() - at_ns < LASTS_S * 1e9:
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
    """Command a motion in safety's name."""
    run = replace(motion, command=Command.RUN, linear=BACKWARD_MPS)
    return {keys.MOTION.on("001"): codec.encode(run)}


def lock_out(motion: Motion, _: Bumper) -> dict[str, bytes]:
    """Go far ahead of all numbers that safety will ever use."""
    return {keys.MOTION.on("001"): codec.encode(replace(motion, seq=2**62))}


def measurements(_: Motion, bumper: Bumper) -> dict[str, bytes]:
    """Report a contact and a runaway in the bridge's name."""
    velocity = Velocity(linear=3.0, angular=0.0, seq=bumper.seq, boot=bumper.boot)
    return {
        keys.BUMPER.on("001"): codec.encode(replace(bumper, pressed=True)),
        keys.VELOCITY.on("001"): codec.encode(velocity),
    }


def hit_while_safety_hangs(lane: Lane) -> int:
    """Stop safety, and press the bumper while the vehicle still moves."""
    os.kill(injectors.pid_of(lane, "safety"), signal.SIGSTOP)
    time.sleep(HUNG_S)
    return injectors.hit(0.3)(lane)
