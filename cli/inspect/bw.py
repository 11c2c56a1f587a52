"""``t2 bw``: how many bytes a key takes.

Payloads and what is attached to them; what the network wraps around them is not counted.
"""

import argparse

from cli.inspect import measure
from cli.inspect.stream_stats import Meter

add_arguments = measure.add_arguments


def run(options: argparse.Namespace) -> int:
    """Tell once a second; 1 when nothing was heard."""
    return measure.run(options, "bw", Meter.bandwidth)
