"""``t2 record``: the recorder, continuously, until Ctrl-C."""

import argparse

from services.recorder import __main__ as service

add_arguments = service.add_arguments


def run(options: argparse.Namespace) -> int:
    """Record; remove no old recordings unless an option says so."""
    options.sets = ["recorder.make_room=false", *options.sets, "recorder.everything=true"]
    return service.run(options)
