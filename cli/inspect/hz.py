"""``t2 hz``: how often a key comes, its gaps and losses.

The average rate, the gaps between two samples, and what was lost on the way by ``seq``.
"""

import argparse

from cli.inspect import measure
from cli.inspect.stream_stats import Meter

add_arguments = measure.add_arguments


def run(options: argparse.Namespace) -> int:
    """Tell once a second; 1 when nothing was heard."""
    return measure.run(options, "hz", Meter.rate)
