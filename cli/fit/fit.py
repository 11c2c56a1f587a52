"""What recordings show of a vehicle, and the settings that follow from it, on the safe side. Pure.

A proposal that a protection depends on is a bound and not a mean (``estimate.py``): decelerations
from below, and ``safety.react`` from above, as what remains of the distance that each stop needed.
So safety reckons with more than any of the stops needed. Each direction needs ``LEAST`` STOPs from
at least 0.4 of the allowed speeds; without them there is no proposal, but the manoeuvre that is
missing. A proposal outside of a setting's safe values is not made.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from math import ceil, floor

from msgspec.structs import replace

from cli.commission.motion import UNIT_MATCH, UNITS
from cli.fit import answers, sonars, steady
from cli.fit.estimate import LEAST, Estimate
from cli.fit.stops import DRIVING, TURNING, Axis, Stop, find_stops
from cli.fit.streams import Streams
from cli.settings import Everything, safety_config
from common.errors import ConfigError
from common.settings import Safe, Section
from common.standstill import stopping_s
from services.safety.config import DECISION_PERIOD_S, SafetyConfig
from t2 import keys

# Safety reckons from the reading of a sonar on, a stop begins with its command: between them are up
# to one period of the sonars and one of the bridge's queries, besides safety's decision.
SENSING_S = 2 / keys.ULTRASONIC.rate_hz
REACT, DECELERATION = "safety.react", "vehicle.deceleration"
ANGULAR = "vehicle.angular_deceleration"
NEARER = 0.98  # of ``vehicle.sonar_max``: a greatest reading that is noise below it is none
FAST, FASTEST = 0.4, 0.7  # of the greatest allowed speed: of many stops, and of one at least

# Allowed deviations from 1: of velocities from counters and from commands, and of counters from the
# ground.
FOLLOWED = 0.9  # share of the commanded slow-down: a vehicle that follows RUN
UNLIKE, UNTRUE, TINY = 0.08, 0.02, 1e-9

Value = float | str


@dataclass(slots=True)
class Fit:
    """Estimates and proposals from the streams of one vehicle."""

    streams: Sequence[Streams]
    settings: Everything  # today's
    stops: list[Stop] = field(default_factory=list)
    left_out: Counter[str] = field(default_factory=Counter)
    estimates: list[Estimate] = field(default_factory=list)
    ranges: list[sonars.Ranges] = field(default_factory=list)  # of each of the streams
    missing: list[str] = field(default_factory=list)  # manoeuvres without which nothing is proposed
    hints: list[str] = field(default_factory=list)
    proposals: dict[str, Value] = field(default_factory=dict)  # by the setting's path

    @property
    def too_long(self) -> list[Stop]:
        """The stops that needed more than safety reckons with today, the worst first."""
        today = safety_config(self.settings)
        spare = {id(stop): reckoned(stop, today) - needed(stop) for stop in self.stops}
        worst_first = sorted(self.stops, key=lambda stop: spare[id(stop)])
        return [stop for stop in worst_first if spare[id(stop)] < 0]


def fit(streams: Sequence[Streams], settings: Everything, truths: Iterable[Estimate] = ()) -> Fit:
    """Measure the vehicle in its streams, one for each start of the robot's computer.

    ``truths`` are ratios of the counters to the ground, ``steady.of_ground_truth``.
    """
    found = Fit(streams, settings)
    for each in streams:
        stops, left_out = find_stops(each)
        found.stops += stops
        found.left_out += left_out
    found.ranges = [it for each in streams if (it := sonars.ranges(each))]
    rest = chain(truths, _rest(streams), *(_of_sonars(each) for each in found.ranges))
    found.estimates = [*of_stops(found.stops, streams), *merged(rest)]
    found.missing = [*missing(found.stops, settings), *doubts(found)]
    found.proposals = dict(_proposals(found))
    return found


def _rest(streams: Sequence[Streams]) -> Iterator[Estimate]:
    for each in streams:
        yield from steady.of_ramps(each)
        yield from steady.of_steady_motion(each)
        yield from steady.of_standstill(each)
        if hits := answers.hits_s(each.bumpers):
            yield Estimate(name="hit of the bumper", unit="s", values=hits, resolution=0.02)
        if trips := answers.round_trips_s(each):
            yield Estimate(name="round trip of a query", unit="s", values=trips)


def _of_sonars(ranges: sonars.Ranges) -> Iterator[Estimate]:
    yield from filter(None, (ranges.ends, ranges.noise))


def merged(estimates: Iterable[Estimate]) -> list[Estimate]:
    """Return one estimate for each name, with the observations of all."""
    found: dict[str, Estimate] = {}
    for each in estimates:
        before = found.get(each.name)
        values = (*before.values, *each.values) if before else each.values
        found[each.name] = replace(each, values=values)
    return list(found.values())


# --- stops ----------------------------------------------------------------------------------------


def of_stops(stops: Sequence[Stop], streams: Sequence[Streams]) -> Iterator[Estimate]:
    """Yield reaction and deceleration of each command, in each direction."""
    for axis, setting in ((DRIVING, DECELERATION), (TURNING, ANGULAR)):
        for kind in ("stop", "brake"):
            for direction in axis.directions.values():
                if not (mine := steady_stops(stops, kind, direction)):
                    continue
                of_safety = kind == "stop"  # BRAKE is never reckoned with
                yield Estimate(
                    name=f"{kind.upper()} {direction}: reaction", unit="s",
                    values=tuple(s.reaction for s in mine), resolution=period_s(streams),
                    setting=REACT if of_safety else "",
                )  # fmt: skip
                of = of_decelerations(f"{kind.upper()} {direction}: deceleration", axis, mine)
                yield replace(of, setting=setting if of_safety else "")


def of_decelerations(name: str, axis: Axis, stops: Sequence[Stop]) -> Estimate:
    """Return the deceleration of stops on an axis."""
    values = tuple(stop.deceleration for stop in stops)
    step = max(axis.resolution * stop.deceleration / stop.speed for stop in stops)
    return Estimate(name=name, unit=f"{axis.unit}/s2", values=values, resolution=step)


def period_s(streams: Sequence[Streams]) -> float:
    """Return the time between two velocities, s."""
    return max(each.period_s for each in streams)


def needed(stop: Stop) -> float:
    """Return the distance (m or rad) from the reading to standstill."""
    return stop.distance + stop.speed * (SENSING_S + DECISION_PERIOD_S)


def reckoned(stop: Stop, settings: SafetyConfig) -> float:
    """Return the distance (m or rad) that safety reckons with: as its zones, by the slower axis."""
    stop_s = stopping_s(
        stop.twist, settings.vehicle.deceleration, settings.vehicle.angular_deceleration
    )
    return float(stop.speed * (settings.reaction + stop_s / 2))


def of_command(stops: Sequence[Stop], kind: str, direction: str) -> list[Stop]:
    """Return the stops by this command in this direction."""
    return [stop for stop in stops if (stop.kind, stop.direction) == (kind, direction)]


def steady_stops(stops: Sequence[Stop], kind: str, direction: str) -> list[Stop]:
    """Return those of them, whole ones, in which the vehicle slowed down steadily."""
    found = of_command(stops, kind, direction)
    return [stop for stop in found if stop.is_steady and stop.is_whole]


def fast_stops(stops: Sequence[Stop], direction: str, settings: Everything) -> list[Stop]:
    """Return the STOPs from at least 0.4 of the allowed speeds, without those in curves."""
    least = FAST * (limits(settings)[axis_of(direction).unit])
    found = steady_stops(stops, "stop", direction)
    return [s for s in found if s.speed >= least and not s.is_curve]


def missing(stops: Sequence[Stop], settings: Everything) -> Iterator[str]:
    """Yield the manoeuvres without which nothing is proposed."""
    for axis in (DRIVING, TURNING):
        most, unit = limits(settings)[axis.unit], f"{axis.unit}/s"
        for direction in axis.directions.values():
            fast = fast_stops(stops, direction, settings)
            if (number := LEAST - len(fast)) > 0:
                yield f"{number} more of STOP {direction} from {FAST * most:.2f} {unit} or more"
            elif (fastest := max(s.speed for s in fast)) < FASTEST * most:
                yield (
                    f"a STOP {direction} from {FASTEST * most:.2f} {unit} or more: the fastest is "
                    f"from {fastest:.2f} of the {most:g} that are allowed"
                )


def doubts(found: Fit) -> Iterator[str]:
    """Yield what contradicts the measured stops, so that nothing may follow from them."""
    stops = [stop for stop in found.stops if stop.kind == "stop" and stop.is_whole]
    for stop in stops:
        if not stop.is_steady:
            yield (
                f"a steady STOP {stop.direction}: the one from {stop.speed:.2f} {stop.axis.unit}/s "
                f"that needed {stop.distance:.2f} {stop.axis.unit} did not slow down by itself"
            )
    for name, axis in (("driving", DRIVING), ("turning", TURNING)):
        yield from _doubts_of(name, [s for s in stops if s.axis is axis and not s.is_curve])
    for each in found.estimates:
        if each.name in steady.GROUND and abs(each.mean - 1) > UNTRUE:
            yield f"true counters: {each.name} is {each.mean:.3f}"


def _doubts_of(name: str, stops: Sequence[Stop]) -> Iterator[str]:
    """Yield what contradicts the stops of one axis."""
    counted_way = sum(stop.distance for stop in stops)
    ratio = sum(stop.integrated for stop in stops) / counted_way if counted_way else 1.0
    if abs(ratio - 1) > UNLIKE:
        yield f"velocities and counters that agree: {name} to standstill {ratio:.2f} : 1"
    obeyed = [stop.speed / stop.commanded for stop in stops if stop.commanded > 0]
    if (fastest := max(obeyed, default=1.0)) > 1 + UNLIKE:
        yield f"a vehicle that obeys: {name} it was {fastest:.2f} times as fast as commanded"


def limits(settings: Everything) -> dict[str, float]:
    """Return the greatest allowed speed of each axis, by its unit."""
    return {DRIVING.unit: settings.vehicle.max_linear, TURNING.unit: settings.vehicle.max_angular}


# --- proposals ------------------------------------------------------------------------------------


def _proposals(found: Fit) -> Iterator[tuple[str, Value]]:
    """Yield the settings that are proposed, with their values."""
    if not found.missing:
        yield from _of_stopping(found)
    for estimate in found.estimates:
        if estimate.setting.startswith("wire.") and (unit := _unit(estimate, found.settings)):
            yield estimate.setting, unit
        if estimate.setting == sonars.SETTING:
            nearest = min(estimate.values)
            if nearest < NEARER * found.settings.vehicle.sonar_max:
                yield sonars.SETTING, round(nearest, 3)


def refusal(found: Fit) -> str:
    """Return why safety would refuse to start with the proposals; empty if it would not."""
    sections: dict[str, dict[str, Value]] = {"safety": {}, "vehicle": {}}
    for path, value in found.proposals.items():
        section, _, name = path.partition(".")
        sections.get(section, {})[name] = value
    vehicle = replace(found.settings.vehicle, **sections["vehicle"])
    safety = replace(found.settings.safety, **sections["safety"])
    try:
        safety_config(replace(found.settings, vehicle=vehicle, safety=safety))
    except ConfigError as error:
        return str(error)
    return ""


def _of_stopping(found: Fit) -> Iterator[tuple[str, Value]]:
    """Yield reaction and decelerations of all stops; nothing while their bounds are not safe."""
    safe = safe_values(found.settings)
    decelerations = {
        path: min(down(least_deceleration(found, axis)), safe[path].high, of_run(found, axis))
        for path, axis in ((DECELERATION, DRIVING), (ANGULAR, TURNING))
    }
    if any(value < safe[path].low for path, value in decelerations.items()):
        found.missing.append("stops that agree better: the bound of a deceleration is too low")
        return
    react = max(up(longest_wait(found, decelerations)), safe[REACT].low)
    if react > safe[REACT].high:
        found.missing.append("stops that agree better: the bound of the reaction is too high")
        return
    yield REACT, react
    yield from decelerations.items()
    for path, axis in ((DECELERATION, DRIVING), (ANGULAR, TURNING)):
        if (shown := down(least_deceleration(found, axis))) > decelerations[path]:
            found.hints.append(
                f"A STOP slows down by {shown:g} {axis.unit}/s2. Near an obstacle RUN has to, too: "
                f"to use more than {decelerations[path]:g}, set {path}, and repeat the slow-downs"
            )


def least_deceleration(found: Fit, axis: Axis) -> float:
    """Return the lower bound of the decelerations from at least 0.4 of the allowed speeds.

    A slow stop is all reaction: there the slope depends on the motors' lag.
    """
    return min(
        of_decelerations("", axis, fast).lower_bound
        for direction in axis.directions.values()
        if (fast := fast_stops(found.stops, direction, found.settings))
    )


def of_run(found: Fit, axis: Axis) -> float:
    """Return the deceleration that RUN has shown, at most today's.

    Near an obstacle safety slows down by RUN, at today's deceleration: a stronger one has not been
    commanded, so nothing is known of it. Without a slow-down today's stays.
    """
    body = found.settings.vehicle
    is_driving = axis is DRIVING
    today = body.deceleration if is_driving else body.angular_deceleration
    name = steady.SLOWING.format(axis="driving" if is_driving else "turning")
    shares = next((each for each in found.estimates if each.name == name), None)
    if shares is None:
        return today
    is_bound = len(shares.values) >= LEAST
    share = shares.lower_bound if is_bound else min(shares.values)
    return today if share >= FOLLOWED else down(today * share)


def longest_wait(found: Fit, decelerations: Mapping[str, float]) -> float:
    """Return the upper bound of the time that safety must reckon with before slowing down, s.

    It is the reaction, or what remains of the distance that a stop needed beside v * t / 2 and the
    decision, if that is longer: a vehicle with lag stops along no line.
    """
    bounds = [each.upper_bound + SENSING_S for each in found.estimates if each.setting == REACT]
    for direction in (*DRIVING.directions.values(), *TURNING.directions.values()):
        waits = []
        for stop in steady_stops(found.stops, "stop", direction):
            if not stop.is_curve:  # there the other axis may stop later, and time is to spare
                stop_s = stopping_s(stop.twist, decelerations[DECELERATION], decelerations[ANGULAR])
                waits.append(needed(stop) / stop.speed - stop_s / 2 - DECISION_PERIOD_S)
        wait = Estimate(name="", unit="s", values=tuple(waits), resolution=period_s(found.streams))
        bounds.append(wait.upper_bound)
    return max(bounds)


def safe_values(settings: Everything) -> dict[str, Safe]:
    """Return the safe values of the settings that may be proposed."""
    sections: dict[str, Section] = {"safety": settings.safety, "vehicle": settings.vehicle}
    return dict(
        chain.from_iterable(
            ((f"{name}.{path}", safe) for path, safe in section.protections().items())
            for name, section in sections.items()
        )
    )


def _unit(estimate: Estimate, settings: Everything) -> str:
    """Return the firmware's unit if it explains a ratio of turning rates; empty otherwise."""
    command = estimate.setting == "wire.command_angular_unit"
    wire = settings.wire
    today = wire.command_angular_unit if command else wire.feedback_angular_unit
    (other,) = UNITS.keys() - {today}
    matches = [
        abs(ratio * UNITS[today] / UNITS[other] - 1) <= UNIT_MATCH
        for each in estimate.interval
        # A larger unit of the firmware makes our reading smaller.
        for ratio in (abs(each) if command else 1 / max(abs(each), TINY),)
    ]
    return other if all(matches) and len(estimate.values) >= LEAST else ""


def up(value: float) -> float:
    """Return a value rounded up to 0.01."""
    return ceil(value * 100 - 1e-6) / 100


def down(value: float) -> float:
    """Return a value rounded down to 0.01."""
    return floor(value * 100 + 1e-6) / 100


def axis_of(direction: str) -> Axis:
    """Return the axis of a direction."""
    return DRIVING if direction in DRIVING.directions.values() else TURNING
