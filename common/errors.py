"""Exceptions of T2.

RobotError
├── WireError      a frame that violates the vehicle's protocol
├── MessageError   a message that violates the bus contract
├── ConfigError    a setting that is missing, unknown or out of range
└── LinkError      a socket, session or peer that cannot be reached
"""


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
