"""A healthy safety state for tests."""

from common.messages import Limits, SafetyState


def safety_state(heartbeat: int) -> SafetyState:
    """Return a safety state without causes or latches; the publisher adds its ``boot``."""
    return SafetyState(
        verdict="run",
        latched=(),
        causes=(),
        source=None,
        limits=Limits(forward=1.0, backward=1.0, angular=1.0),
        heartbeat=heartbeat,
        text="",
    )
