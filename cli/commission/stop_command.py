"""``t2 checkout stop``: measured stops of recordings, and the settings of safety for them."""

import argparse
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from msgspec.structs import replace

from cli.commission.stop_fit import Settings
from cli.commission.stop_report import Measured, as_json, as_text, evaluate
from cli.commission.stops import Stop, Streams, find_stops
from cli.inspect import output
from cli.inspect.session import wants_json
from cli.recordings.info import open_recording
from cli.settings import Everything
from common.errors import ConfigError, RobotError
from common.keys import ROOT
from services.safety.config import SafetyConfig

# A reading is up to one period of the sonars old, and up to one period of the bridge's queries.
READING_PERIODS = 2
KINDS = {"Motion", "Velocity", "Mileage", "Bumper"}  # the messages that ``Streams`` takes


def run(options: argparse.Namespace, config: Everything) -> int:
    """Show the stops of the recordings; return 0 if the present settings are safe for them."""
    if not options.files:
        raise ConfigError(
            "stop: name at least one recording: start `t2 record` on the robot, drive and stop"
        )
    measured = read(options.files)
    sensing_s = READING_PERIODS / config.bridge.ultrasonic_rate
    result = evaluate(measured, config.safety, sensing_s)
    if wants_json(options):
        output.line(as_json(result))
    else:
        print(as_text(result), flush=True)
    if result.proposal is not None and (refusal := refused(config, result.proposal)):
        output.warn(f"the proposed settings are refused with these files: {refusal}")
    return 0 if result.passed else 1


def read(files: Sequence[Path]) -> Measured:
    """Return the stops of all recordings; raise ``RobotError`` without any."""
    stops: list[Stop] = []
    left_out: Counter[str] = Counter()
    period_s = 0.0
    for file in files:
        streams = read_streams(file)
        found, reasons = find_stops(streams, file.name)
        known = {stop.command for stop in stops}
        new = [stop for stop in found if stop.command not in known]
        stops += new
        left_out["in two recordings"] += len(found) - len(new)
        left_out += reasons
        period_s = max(period_s, streams.period_s)
    if not stops:
        reasons_text = ", ".join(f"{count} {reason}" for reason, count in left_out.most_common())
        raise RobotError(
            f"no stop to measure: a STOP or BRAKE from a steady speed, until standstill "
            f"({reasons_text or 'no RUN with speed ends'})"
        )
    return Measured(stops, +left_out, period_s)


def read_streams(file: Path) -> Streams:
    """Return the messages of one recording; raise ``RobotError`` if it shows no stops."""
    streams, robots = Streams(), set()
    with open_recording(file) as reader:
        for entry in reader:
            if entry.kind in KINDS and (message := entry.message) is not None:
                streams.add(message)
                robots.add(entry.key.removeprefix(f"{ROOT}/").split("/")[0])
    if len(robots) > 1:
        raise RobotError(f"{file}: has several robots ({', '.join(sorted(robots))}): record one")
    if streams.problem:
        raise RobotError(f"{file}: {streams.problem}")
    return streams


def refused(config: Everything, proposal: Settings) -> str:
    """Return why safety refuses the proposed settings, or an empty string."""
    try:
        safety = replace(config.safety, **asdict(proposal))
        SafetyConfig(vehicle=config.vehicle, safety=safety)
    except ValueError as error:
        return str(error)
    return ""
