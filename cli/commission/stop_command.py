"""``t2 checkout stop``: table of the stops in recordings, beside what safety reckons with."""

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from cli.commission.stops import DRIVING, TURNING, Axis, Stop, Streams, find_stops
from cli.inspect import output
from cli.inspect.addressing import chunks
from cli.recordings.info import open_recording
from cli.settings import Everything, safety_config
from common.errors import ConfigError
from common.standstill import stopping_s
from services.safety.config import DECISION_PERIOD_S, SafetyConfig
from t2 import keys
from t2.errors import T2Error

# Safety reckons from the reading of a sonar on, a stop begins with its command: between them are up
# to one period of the sonars and one of the bridge's queries, besides safety's decision.
SENSING_S = 2 / keys.ULTRASONIC.rate_hz
KINDS = {"Motion", "Velocity", "Mileage", "Bumper"}  # the messages that ``Streams`` takes
HEAD = ("stop", "command", "unit", "speed", "reaction s", "deceleration", "distance",
        "needed", "reckoned", "recording")  # fmt: skip


def run(options: argparse.Namespace, config: Everything) -> int:
    """Show the stops of the recordings; return 0 if none was longer than reckoned."""
    if not options.files:
        raise ConfigError(
            "stop: name at least one recording: start `t2 record` on the robot, drive and stop"
        )
    settings = safety_config(config)
    stops, left_out = read(options.files, options.robot)
    rows = [as_cells(number, stop, settings) for number, stop in enumerate(stops, 1)]
    passed, lines = verdict(stops, settings)
    print(output.table(HEAD, rows), "", sep="\n")
    if left_out:
        print(f"Left out: {counted(left_out)}.")
    print(*lines, sep="\n", flush=True)
    return 0 if passed else 1


def read(files: Sequence[Path], robot: str | None) -> tuple[list[Stop], Counter[str]]:
    """Return the stops of all recordings, and why others are left out.

    Raise ``T2Error`` without any, and for several robots: ``robot`` chooses one.
    """
    robots: set[str] = set()
    stops: dict[tuple[object, ...], Stop] = {}
    left_out: Counter[str] = Counter()
    for file in files:
        found, reasons = find_stops(read_streams(file, robot, robots), file.name)
        left_out += reasons
        for stop in found:
            key = (*stop.command, stop.axis.unit)
            left_out["in two recordings"] += key in stops
            stops.setdefault(key, stop)
    if len(robots) > 1:
        raise T2Error(f"recordings of {', '.join(sorted(robots))}: choose one with --robot")
    if not stops:
        raise T2Error(
            f"no stop to measure: a STOP or BRAKE from a steady speed, until standstill "
            f"({counted(left_out) or 'no RUN with speed ends'})"
        )
    return list(stops.values()), +left_out


def read_streams(file: Path, robot: str | None, robots: set[str]) -> Streams:
    """Return a robot's messages in one recording, and add its robots to ``robots``.

    Raise ``T2Error`` if it shows no stops.
    """
    streams = Streams()
    with open_recording(file) as reader:
        for entry in reader:
            name = chunks(entry.key)[0]
            if entry.kind not in KINDS or robot not in (None, name):
                continue
            if (message := entry.message) is not None:
                robots.add(name)
                streams.add(message)
    if streams.problem:
        raise T2Error(f"{file}: {streams.problem}")
    return streams


def counted(reasons: Counter[str]) -> str:
    """Return the reasons with their counts as text."""
    return ", ".join(f"{count} {reason}" for reason, count in reasons.most_common())


def needed(stop: Stop) -> float:
    """Return the distance (m or rad) from the reading to standstill."""
    return stop.distance + stop.speed * (SENSING_S + DECISION_PERIOD_S)


def reckoned(stop: Stop, settings: SafetyConfig) -> float:
    """Return the distance (m or rad) that safety reckons with: as its zones, by the slower axis."""
    stop_s = stopping_s(
        stop.twist, settings.vehicle.deceleration, settings.vehicle.angular_deceleration
    )
    return stop.speed * (settings.reaction + stop_s / 2)


def as_cells(number: int, stop: Stop, settings: SafetyConfig) -> Sequence[str]:
    """Return one stop as table cells."""
    return (
        str(number),
        f"{stop.kind.upper()} {stop.direction}" + ", then BRAKE" * stop.braked,
        stop.axis.unit,
        f"{stop.speed:.3f}",
        f"{stop.reaction:z.3f}",
        f"{stop.deceleration:.2f}",
        f"{stop.distance:.3f}",
        f"{needed(stop):.3f}",
        f"{reckoned(stop, settings):.3f}",
        stop.file,
    )


def verdict(stops: Sequence[Stop], settings: SafetyConfig) -> tuple[bool, Iterator[str]]:
    """Return whether the vehicle passes, and the lines below the table.

    It passes with a STOP, which is what an obstacle causes, forward, backward and turning to both
    sides, and without a stop that was longer than reckoned.
    """
    spare = [reckoned(stop, settings) - needed(stop) for stop in stops]
    worst = min(range(len(stops)), key=spare.__getitem__)
    found = {stop.direction for stop in stops if stop.kind == "stop"}
    wanted = (*DRIVING.directions.values(), *TURNING.directions.values())
    missing = [each for each in wanted if each not in found]

    def lines() -> Iterator[str]:
        unit = stops[worst].axis.unit
        yield (
            f"The worst is stop {worst + 1}: from the reading to standstill it needs "
            f"{needed(stops[worst]):.2f} {unit}, reckoned are "
            f"{reckoned(stops[worst], settings):.2f} {unit}."
        )
        yield (
            f"The slowest reaction is {max(each.reaction for each in stops) + SENSING_S:.2f} s "
            f"from the reading (safety.react is {settings.reaction - DECISION_PERIOD_S:g} s)."
        )
        body = settings.vehicle
        yield from of_axis(stops, DRIVING, "deceleration", body.deceleration, body.max_linear)
        yield from of_axis(
            stops, TURNING, "angular_deceleration", body.angular_deceleration, body.max_angular
        )
        for direction in missing:
            yield f"NOT MEASURED: a STOP {direction}."
        if spare[worst] < 0:
            yield "NOT SAFE: this vehicle needs more than safety reckons with."
        elif not missing:
            yield "No stop was longer than safety reckons with."

    return not missing and spare[worst] >= 0, lines()


def of_axis(
    stops: Sequence[Stop], axis: Axis, name: str, reckoned_with: float, allowed: float
) -> Iterator[str]:
    """Yield the weakest deceleration and the fastest stop of an axis, if there is any."""
    if mine := [stop for stop in stops if stop.axis is axis]:
        weakest, fastest = min(s.deceleration for s in mine), max(s.speed for s in mine)
        yield (
            f"The weakest deceleration is {weakest:.2f} {axis.unit}/s2 (vehicle.{name} is "
            f"{reckoned_with:g} {axis.unit}/s2). The fastest stop is from {fastest:.2f} "
            f"{axis.unit}/s; safety allows {allowed:g} {axis.unit}/s."
        )
