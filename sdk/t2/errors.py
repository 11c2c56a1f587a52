"""Errors: each states what happened, and what to do."""

from collections.abc import Sequence

from t2.messages import Cause, SafetyState


class T2Error(Exception):
    """Base of all errors of this library.

    ``left`` is what is left of the motion that ends with it, in ``unit``: m, or rad of a turn; None
    without a motion.
    """

    left: float | None = None
    unit: str = ""

    def __str__(self) -> str:
        left = "" if self.left is None else f" Left of the motion: {self.left:.2f} {self.unit}."
        return self.what + left

    @property
    def what(self) -> str:
        """What happened, and what to do."""
        return super().__str__()


class LinkError(T2Error):
    """A router, socket or peer cannot be reached, or the robot was closed."""


class MessageError(T2Error):
    """A message that violates the bus contract."""


class NoData(T2Error):
    """No message arrived in time."""


class Incompatible(T2Error):
    """The robot's stack is of another version than this package, and its messages differ."""


class NotAllowed(T2Error):
    """The router drops our requests or calls, or safety does not know our source."""


class Late(T2Error):
    """Requests reach safety too late: the link is slow, or this program was held up."""


class NotConfirmed(T2Error):
    """Safety's state does not show the effect: look at the vehicle; it has a switch of its own."""


class Refused(T2Error):
    """A service refused a call; the text is its reason."""


class Overruled(T2Error):
    """Another source drives; ``by`` is its name."""

    def __init__(self, by: str) -> None:
        super().__init__(by)  # the arguments, so that it survives pickling
        self.by: str = by

    @property
    def what(self) -> str:
        """What happened."""
        return f"overruled by {self.by}, which has a higher priority."


class PoseSet(T2Error):
    """Odometry restarted, or its pose was set, during a motion.

    In ``map``: the vehicle was placed anew, or localization restarted.
    """


class Lost(T2Error):
    """The pose in the map is not known, or not well enough: place the vehicle."""


class Stopped(T2Error):
    """Safety stops the vehicle; ``causes`` are the reasons, the worst first."""

    def __init__(self, text: str, causes: Sequence[Cause]) -> None:
        super().__init__(text, causes)
        self.text: str = text
        self.causes: tuple[Cause, ...] = tuple(causes)

    @property
    def what(self) -> str:
        """Safety's text."""
        return self.text


class Latched(Stopped):
    """A cause is latched: somebody must look at the vehicle, then ``Robot.reset``."""

    @classmethod
    def of(cls, state: SafetyState) -> "Latched":
        """Return the error of a latched state."""
        return cls(state.text, [cause for cause in state.causes if cause.name in state.latched])


class Blocked(Stopped):
    """The vehicle does not get on, for example because of an obstacle."""
