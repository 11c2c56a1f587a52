"""A simulated robot for the tests of the client library."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import t2
from cli.settings import Everything
from common.child_process import command
from verification.harness.bus import set_options
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import wait_until

SETS = ('safety.limits.detector={lease=1.0, silence="ignore"}',)


def library_stack(folder: Path) -> AbstractContextManager[RunningStack]:
    """Run the stack with patrol and a source of limits, ``detector``."""

    def beside(config: Everything) -> dict[str, list[str]]:
        words = set_options(f"bus.connect={config.bus.endpoints[0]}", f"patrol.folder={folder}")
        return {"patrol": command("services.patrol", *words)}

    return running_stack(folder, sets=SETS, beside=beside)


@contextmanager
def ready(stack: RunningStack) -> Iterator[t2.Robot]:
    """Connect, and wait until the robot may drive."""
    with t2.connect("001", endpoint=stack.endpoint) as it:
        it.odometry.latest(timeout=20.0)
        wait_until(lambda: not blocked(it), "a vehicle that may drive")
        yield it


def blocked(robot: t2.Robot) -> bool:
    """Return whether something else than a missing request stops the vehicle; reset it."""
    state = robot.safety.latest(timeout=5.0)
    if state.latched:
        try:
            robot.reset()
        except (t2.Refused, t2.NotConfirmed):
            return True
    return not {cause.name for cause in state.causes} <= {"no_request", "neutral"}
