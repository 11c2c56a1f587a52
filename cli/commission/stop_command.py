"""``t2 checkout stop``: table of the stops in recordings, beside what safety reckons with."""

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from cli.commission.stops import DIRECTIONS, Stop, Streams, find_stops
from cli.inspect import output
from cli.recordings.info import open_recording
from cli.settings import Everything
from common import keys
from common.errors import ConfigError, RobotError
from services.safety.config import Safety
from services.safety.core.release import stopping_distance

# A reading is up to one period of the sonars old, and up to one period of the bridge's queries.
SENSING_S = 2 / keys.ULTRASONIC.rate_hz
KINDS = {"Motion", "Velocity", "Mileage", "Bumper"}  # the messages that ``Streams`` takes
HEAD = ("stop", "command", "speed m/s", "reaction s", "deceleration m/s2", "distance m",
        "needed m", "reckoned m", "recording")  # fmt: skip


@dataclass(frozen=True, slots=True)
class Result:
    """Stops beside safety's settings.

    Safety reckons from the reading of a sonar on, a stop begins with its command: ``sensing_s``
    lies between them.
    """

    stops: Sequence[Stop]
    left_out: Counter[str]
    safety: Safety
    sensing_s: float

    def reckoned(self, stop: Stop) -> float:
        """Return the stopping distance (m) that safety reckons with from this speed."""
        return stopping_distance(stop.speed, self.safety.reaction, self.safety.deceleration)

    def needed(self, stop: Stop) -> float:
        """Return the distance (m) from the reading to standstill."""
        return stop.distance + stop.speed * self.sensing_s

    def spare(self, stop: Stop) -> float:
        """Return by how much (m) the stop was shorter than reckoned."""
        return self.reckoned(stop) - self.needed(stop)

    @property
    def worst(self) -> int:
        """The index of the stop with the least to spare."""
        return min(range(len(self.stops)), key=lambda n: self.spare(self.stops[n]))

    @property
    def missing(self) -> list[str]:
        """The directions without a STOP, which is what an obstacle causes."""
        found = {stop.direction for stop in self.stops if stop.kind == "stop"}
        return [each for each in DIRECTIONS.values() if each not in found]

    @property
    def passed(self) -> bool:
        """Whether both directions have a STOP, and no stop was longer than reckoned."""
        return not self.missing and self.spare(self.stops[self.worst]) >= 0


def run(options: argparse.Namespace, config: Everything) -> int:
    """Show the stops of the recordings; return 0 if none was longer than reckoned."""
    if not options.files:
        raise ConfigError(
            "stop: name at least one recording: start `t2 record` on the robot, drive and stop"
        )
    result = Result(*read(options.files), config.safety, SENSING_S)
    rows = [as_cells(result, n) for n in range(len(result.stops))]
    print(output.table(HEAD, rows), "", *verdict(result), sep="\n", flush=True)
    return 0 if result.passed else 1


def read(files: Sequence[Path]) -> tuple[list[Stop], Counter[str]]:
    """Return the stops of all recordings, and why others are left out.

    Raise ``RobotError`` without any.
    """
    stops: dict[tuple[int, int], Stop] = {}
    left_out: Counter[str] = Counter()
    for file in files:
        found, reasons = find_stops(read_streams(file), file.name)
        left_out += reasons
        for stop in found:
            left_out["in two recordings"] += stop.command in stops
            stops.setdefault(stop.command, stop)
    if not stops:
        reasons_text = ", ".join(f"{count} {reason}" for reason, count in left_out.most_common())
        raise RobotError(
            f"no stop to measure: a STOP or BRAKE from a steady speed, until standstill "
            f"({reasons_text or 'no RUN with speed ends'})"
        )
    return list(stops.values()), +left_out


def read_streams(file: Path) -> Streams:
    """Return the messages of one recording; raise ``RobotError`` if it shows no stops."""
    streams, robots = Streams(), set()
    with open_recording(file) as reader:
        for entry in reader:
            if entry.kind in KINDS and (message := entry.message) is not None:
                streams.add(message)
                robots.add(entry.key.removeprefix(f"{keys.ROOT}/").split("/")[0])
    if len(robots) > 1:
        raise RobotError(f"{file}: has several robots ({', '.join(sorted(robots))}): record one")
    if streams.problem:
        raise RobotError(f"{file}: {streams.problem}")
    return streams


def as_cells(result: Result, index: int) -> Sequence[str]:
    """Return one stop as table cells."""
    stop = result.stops[index]
    return (
        str(index + 1),
        f"{stop.kind.upper()} {stop.direction}" + ", then BRAKE" * stop.braked,
        f"{stop.speed:.3f}",
        f"{stop.reaction:z.3f}",
        f"{stop.deceleration:.2f}",
        f"{stop.distance:.3f}",
        f"{result.needed(stop):.3f}",
        f"{result.reckoned(stop):.3f}",
        stop.file,
    )


def verdict(result: Result) -> Iterator[str]:
    """Yield the lines below the table."""
    safety, stops = result.safety, result.stops
    if result.left_out:
        left = ", ".join(f"{count} {reason}" for reason, count in result.left_out.most_common())
        yield f"Left out: {left}."
    worst = stops[result.worst]
    spare = result.spare(worst)
    yield (
        f"The worst is stop {result.worst + 1}: from the reading to standstill it needs "
        f"{result.needed(worst):.2f} m, reckoned are {result.reckoned(worst):.2f} m."
    )
    reaction = max(stop.reaction for stop in stops) + result.sensing_s
    yield (
        f"The slowest reaction is {reaction:.2f} s from the reading (safety.react is "
        f"{safety.reaction:g} s), the weakest deceleration "
        f"{min(stop.deceleration for stop in stops):.2f} m/s2 (safety.deceleration is "
        f"{safety.deceleration:g} m/s2)."
    )
    fastest = max(stop.speed for stop in stops)
    yield f"The fastest stop is from {fastest:.2f} m/s; safety allows {safety.max_linear:g} m/s."
    for direction in result.missing:
        yield f"NOT MEASURED: a STOP {direction}."
    if spare < 0:
        yield "NOT SAFE: this vehicle needs more than safety reckons with."
    elif result.passed:
        yield "No stop was longer than safety reckons with."
