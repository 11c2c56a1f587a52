"""The scenarios, one module for each topic; importing a module adds its own."""

from verification.outside.scenarios import (
    authority,
    board,
    contact,
    keepalive,
    limits,
    operator,
    restarts,
    sonar,
    standstill,
    unkind_link,
    unkind_motors,
    unkind_sensors,
)
from verification.outside.testbed import SCENARIOS

__all__ = [
    "SCENARIOS",
    "authority",
    "board",
    "contact",
    "keepalive",
    "limits",
    "operator",
    "restarts",
    "sonar",
    "standstill",
    "unkind_link",
    "unkind_motors",
    "unkind_sensors",
]
