"""What can go wrong, as a tree.

RobotError
├── WireError      a frame that the vehicle's protocol does not allow
├── MessageError   a message that the bus contract does not allow
├── ConfigError    a setting that is missing, unknown or out of range
└── LinkError      a socket, session or peer that cannot be reached
"""


class RobotError(Exception):
    """Anything that T2 itself reports as wrong."""


class WireError(RobotError):
    """A frame that the vehicle's protocol does not allow."""


class MessageError(RobotError):
    """A message that the bus contract does not allow."""


class ConfigError(RobotError):
    """A setting that is missing, unknown or out of range."""


class LinkError(RobotError):
    """A socket, session or peer that cannot be reached."""
