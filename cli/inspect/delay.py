"""``t2 delay``: how long messages are under way.

By this host's own clock where sender and reader share it (clock ``host``); otherwise by both wall
clocks, whose difference is then in the figures (clock ``wall``).
"""

import argparse

from cli.inspect import measure
from cli.inspect.stream_stats import Meter

add_arguments = measure.add_arguments


def run(options: argparse.Namespace) -> int:
    """Tell once a second; 1 when nothing was heard."""
    return measure.run(options, "delay", Meter.delay)
