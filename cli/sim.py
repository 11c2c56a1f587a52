"""``t2 sim``: the simulated vehicle alone."""

from sim.__main__ import add_arguments, run

__all__ = ["add_arguments", "run"]
