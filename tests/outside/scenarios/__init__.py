"""The scenarios, one module for each topic; importing a module adds its own."""

from tests.outside.scenarios import authority, board, contact, operator, restarts, sonar, standstill
from tests.outside.testbed import SCENARIOS

__all__ = [
    "SCENARIOS",
    "authority",
    "board",
    "contact",
    "operator",
    "restarts",
    "sonar",
    "standstill",
]
