"""Exceptions of T2; all are a ``RobotError``."""


class RobotError(Exception):
    """Base class of all errors that T2 raises."""


class WireError(RobotError):
    """A frame that violates the vehicle's protocol."""


class MessageError(RobotError):
    """A message that violates the bus contract."""


class ConfigError(RobotError):
    """A setting that is missing, unknown or out of range."""


class LinkError(RobotError):
    """A socket, session or peer that cannot be reached."""
