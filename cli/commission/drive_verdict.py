"""Verdict on one manoeuvre of the guided drive, and the conditions to begin. Pure."""

import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import mean, median, pstdev
from typing import TypeVar

from cli.commission.manoeuvres import Manoeuvre, reach, speed
from cli.commission.motion import NOTHING
from cli.commission.report import Row, Verdict
from cli.commission.supervision import FULL, UNLIKE, Problem, Then, Travel, unlike
from cli.fit.fit import SENSING_S, needed, reckoned
from cli.fit.stops import DRIVING, TURNING, Kind, Stop, counted, find_stops
from cli.fit.streams import COARSEST_S, Streams
from common.freshness import NS_PER_S, Latest
from common.motion import STANDING_MPS, STANDING_RADPS, Twist
from services.safety.config import DECISION_PERIOD_S, SafetyConfig
from t2.messages import Bumper, Command, Health, Mileage, Motion, SafetyState, Switches, Velocity
from t2.words import Language, render

MEASURED_S = 0.5  # before the end of the requests
RESOLUTION = 0.003  # m or rad: of the counters, which have steps of 1 mm and 0.1 degrees
ROUNDING = 1e-6
RECORDER = "recorder"
START_RECORDER = "start `t2 record` on the robot, in another terminal"

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Drive:
    """One manoeuvre as it went, with all messages from its start to after its standstill."""

    manoeuvre: Manoeuvre
    ended_ns: int  # when the checkout ended its requests, by the local clock
    stood: bool  # whether the vehicle came to standstill in time
    motions: Sequence[Latest[Motion]]
    velocities: Sequence[Latest[Velocity]]
    mileages: Sequence[Latest[Mileage]]
    bumpers: Sequence[Latest[Bumper]]
    states: Sequence[Latest[SafetyState]]
    is_steady: bool = True  # whether it reached a steady speed
    problem: Problem | None = None  # found while it moved
    language: Language = "en"  # of safety's texts


@dataclass(frozen=True, slots=True)
class Result:
    """Verdict on a manoeuvre, and what follows when it failed."""

    verdict: Verdict
    then: Then = "again"


def judge_drive(drive: Drive, settings: SafetyConfig) -> Result:
    """Return the verdict on one manoeuvre."""
    stops, reason = _stops(drive)
    data = (*_speeds(drive), *_stop_data(stops, settings))
    problem = drive.problem or next(_problems(drive, stops, reason, settings), None)
    if problem:
        return Result(Verdict("failed", problem.text, data), problem.then)
    return Result(Verdict("passed", _travelled(drive), data))


def judge_standstill(drive: Drive) -> Result:
    """Return the verdict on a standstill without requests: bias, noise and drift."""
    velocities, mileages = _values(drive.velocities), _values(drive.mileages)
    if len(velocities) < 2 or len(mileages) < 2:
        return Result(Verdict("failed", "No velocities or no counters are received."), "end")
    linear, angular = [v.linear for v in velocities], [v.angular for v in velocities]
    moved = abs(mileages[-1].distance - mileages[0].distance)
    turned = abs(math.remainder(mileages[-1].heading - mileages[0].heading, math.tau))
    data = (
        ("measured", f"{mean(linear):+.4f} m/s, {mean(angular):+.4f} rad/s"),
        ("noise", f"{pstdev(linear):.4f} m/s, {pstdev(angular):.4f} rad/s"),
        ("counted", f"{moved:.3f} m, {turned:.4f} rad"),
    )
    problem = _at_standstill(drive, Twist(mean(linear), mean(angular)))
    if problem:
        return Result(Verdict("failed", problem, data), "end")
    return Result(Verdict("passed", "It stands.", data))


def writing_recorders(health: Iterable[Health]) -> dict[int, int]:
    """Return ``boot`` and ``host`` of each recorder that writes all messages to a file."""
    counts: dict[int, list[int]] = {}
    hosts: dict[int, int] = {}
    for each in health:
        if each.service == RECORDER:
            counts.setdefault(each.boot, []).append(each.counters.get("recorded", 0))
            hosts[each.boot] = each.host
    return {boot: hosts[boot] for boot, recorded in counts.items() if recorded[-1] > recorded[0]}


def recorder_problem(health: Sequence[Health], host: int) -> str:
    """Return why no recording is complete, or an empty string.

    ``health`` are messages of some seconds, ``host`` is the robot's computer; 0 if unknown.
    """
    if not any(each.service == RECORDER for each in health):
        return f"No recorder is running: {START_RECORDER}."
    writing = writing_recorders(health)
    if not writing:
        return (
            "The recorder keeps incidents only (recorder.everything = false), or its disk is full: "
            f"{START_RECORDER}."
        )
    if host and host not in writing.values():
        return f"The recorder is on another computer, which gets fewer messages: {START_RECORDER}."
    return ""


def switches_problem(switches: Switches | None) -> str:
    """Return why the board's own brakes are not confirmed, or an empty string."""
    if switches is not None and switches.ultrasonic_brake and switches.bumper_brake:
        return ""
    return (
        "The board has not confirmed that both its emergency brakes are on: "
        "run `t2 checkout --only link`."
    )


# --- one manoeuvre ------------------------------------------------------------------------------


def _problems(
    drive: Drive, stops: Sequence[Stop], reason: str, settings: SafetyConfig
) -> Iterator[Problem]:
    if not drive.stood:
        yield Problem("It does not stand: it was stopped by an emergency stop. Look at it.", "end")
    if not drive.velocities or not drive.mileages:
        yield Problem("No velocities or no counters: run `t2 checkout --only link`.", "end")
    checks = (_not_granted(drive), _no_motion(drive), unlike(_travel(drive)), _too_slow(drive))
    yield from filter(None, checks)
    if drive.manoeuvre.ending == "slow":
        return
    if reason:
        yield Problem(f"The stop cannot be measured: {reason}.", "again")
    elif drive.manoeuvre.ending != stops[0].kind:
        yield Problem(f"It ended by {stops[0].kind.upper()} instead.", "again")
    yield from filter(None, (_too_long(stop, settings) for stop in stops))


def _not_granted(drive: Drive) -> Problem | None:
    wanted, top = drive.manoeuvre.twist, _fastest(drive)
    pairs = (top.linear, wanted.linear), (top.angular, wanted.angular)
    if all(abs(granted) >= FULL * abs(asked) for granted, asked in pairs):
        return None
    began_ns = min((m.received_ns for m in _runs(drive)), default=drive.ended_ns)
    states = (s.value for s in drive.states if began_ns <= s.received_ns <= drive.ended_ns)
    held = [state for state in states if state.verdict != "run"]
    texts = list(dict.fromkeys(render(it.phrases, drive.language, it.text) for it in held))
    why = f" It reports: {' '.join(texts[-3:])}" if texts else " It had too little space or time."
    return Problem(f"Safety granted at most {speed(top)} of {speed(wanted)}.{why}", "again")


def _no_motion(drive: Drive) -> Problem | None:
    wanted, travel = drive.manoeuvre.twist, _travel(drive)
    expected = drive.manoeuvre.limit
    for unit, asked, counted_, integrated, limit in (
        ("m", wanted.linear, travel.counted.linear, travel.integrated.linear, expected.linear),
        ("rad", wanted.angular, travel.counted.angular, travel.integrated.angular,
         expected.angular),
    ):  # fmt: skip
        if asked and max(abs(counted_), abs(integrated)) < NOTHING * limit:
            return Problem(
                f"No motion: {abs(counted_):.2f} {unit} are counted on a request of {asked:.2f} "
                f"{unit}/s. If the vehicle has moved, end the drive with Ctrl-C and repeat "
                "`t2 checkout`. If not, its wheels may need a higher speed: continue.",
                "again",
            )
    return None


def _too_slow(drive: Drive) -> Problem | None:
    """Return the problem of a speed that is not steady, or is far below the granted one."""
    wanted, measured = drive.manoeuvre.twist, _measured(drive)
    if drive.manoeuvre.group == "return":
        return None  # a short way has no steady part
    if measured is None:
        return Problem("The velocities end too early: run `t2 checkout --only link`.", "end")
    for unit, asked, found, setting in (
        ("m/s", wanted.linear, measured.linear, ""),
        ("rad/s", wanted.angular, measured.angular, "wire.command_angular_unit and "),
    ):
        if asked and abs(found) < (1 - UNLIKE) * abs(asked):
            return Problem(
                f"Too slow: the board measures {found:+.2f} {unit}, granted are {asked:+.2f} "
                f"{unit}: check {setting}whether the wheels slip or the vehicle is too heavy.",
                "again",
            )
    if drive.is_steady or math.isinf(drive.manoeuvre.steady_s):
        return None
    it = drive.manoeuvre
    return Problem(
        f"The speed was not steady within {reach(it.limit)} and {it.seconds:.0f} s: the vehicle "
        "accelerates too slowly, or its velocity is too noisy.",
        "again",
    )


def _too_long(stop: Stop, settings: SafetyConfig) -> Problem | None:
    """Return the problem of a stop that took longer than the settings reckon with."""
    unit, body = stop.axis.unit, settings.vehicle
    name, assumed = (
        ("deceleration", body.deceleration)
        if stop.axis is DRIVING
        else ("angular_deceleration", body.angular_deceleration)
    )
    way, allowed = needed(stop), reckoned(stop, settings)
    figures = (
        f"from {stop.speed:.2f} {unit}/s it needs {way:.3f} {unit}, the settings reckon with "
        f"{allowed:.3f} {unit}"
    )
    if way <= allowed + RESOLUTION:
        if not stop.braked:
            return None
        return Problem(
            f"Safety commanded BRAKE after the STOP, because it rolled on: {figures}. Drive on "
            "level ground.",
            "slower",
        )
    react = settings.reaction - DECISION_PERIOD_S
    lowest = _deceleration(stop, react)
    changes = []
    if stop.reaction + SENSING_S > react:
        changes.append(
            f"safety.react to at least {_up(stop.reaction + SENSING_S):.2f} s (it is "
            f"{settings.safety.react:g})"
        )
    if lowest < assumed:
        changes.append(
            f"vehicle.{name} to at most {_down(lowest):.2f} {unit}/s2 (it is {assumed:g})"
        )
    change = " and ".join(changes) or f"safety.react or vehicle.{name}"
    return Problem(
        f"The stop was too long: {figures}. Do not drive faster: set {change}.", "slower"
    )


def _deceleration(stop: Stop, react: float) -> float:
    """Return the measured deceleration; by the counters alone that which explains the distance."""
    if not math.isnan(stop.deceleration):
        return stop.deceleration
    slowing = stop.distance - stop.speed * (react - SENSING_S)
    return stop.speed**2 / 2 / slowing if slowing > 0 else math.nan


def _stops(drive: Drive) -> tuple[list[Stop], str]:
    """Return the measured stops, one for each axis, or the reason why there are none."""
    if drive.manoeuvre.ending == "slow" or drive.manoeuvre.twist.is_zero:
        return [], ""
    streams = Streams(
        _values(drive.motions), _values(drive.velocities), _values(drive.mileages),
        _values(drive.bumpers),
    )  # fmt: skip
    if streams.period_s > COARSEST_S:
        return [], f"a velocity arrives each {streams.period_s:.2f} s only"
    stops, left_out = find_stops(streams)
    # Without a steady or steadily falling velocity the counters alone show the distance.
    stops = stops or _by_counters(drive)
    return stops, "" if stops else counted(left_out) or "no stop from a RUN with speed"


def _by_counters(drive: Drive) -> list[Stop]:
    """Return the stop of each axis by the counters; reaction and deceleration are unknown."""
    motions, mileages = _values(drive.motions), _values(drive.mileages)
    pairs = pairwise(motions)
    begin = next((b for a, b in pairs if a.command is Command.RUN is not b.command), None)
    before = _measured(drive)
    if begin is None or before is None:
        return []
    first = bisect_right(mileages, begin.mono_ns, key=lambda m: m.mono_ns) - 1
    if first < 0 or first == len(mileages) - 1:
        return []
    kind: Kind = "brake" if begin.command is Command.BRAKE else "stop"
    braked = kind == "stop" and any(m.command is Command.BRAKE for m in motions)
    stops = []
    for axis, speed_ in ((DRIVING, before.linear), (TURNING, before.angular)):
        if not (drive.manoeuvre.twist.linear if axis is DRIVING else drive.manoeuvre.twist.angular):
            continue
        # Until the reading after the command it drove on at this speed.
        late_s = (mileages[first + 1].mono_ns - begin.mono_ns) / NS_PER_S
        steps = [axis.travel(*pair) for pair in pairwise(mileages[first + 1 :])]
        way = abs(sum(steps) + speed_ * late_s)
        direction = axis.directions[math.copysign(1, speed_)]
        stops.append(
            Stop(
                axis=axis,
                kind=kind,
                direction=direction,
                speed=abs(speed_),
                twist=before,
                reaction=math.nan,
                deceleration=math.nan,
                distance=way,
                points=(),
                at_ns=begin.t_ns,
                braked=braked,
            )
        )
    return stops


def _travelled(drive: Drive) -> str:
    """Return the counted travel until standstill."""
    asked, way = drive.manoeuvre.twist, _travel(drive).counted
    parts = [f"travelled {way.linear:+.2f} m"] if asked.linear else []
    parts += [f"turned {math.degrees(way.angular):+.0f} degrees"] if asked.angular else []
    return f"It has {' and '.join(parts)}, as expected."


# --- figures ------------------------------------------------------------------------------------


def _speeds(drive: Drive) -> Iterator[Row]:
    yield "commanded", _signed(_fastest(drive))
    begin_ns = drive.ended_ns - round(MEASURED_S * NS_PER_S)
    if measured := _measured(drive):
        yield "measured", _signed(measured, drive.manoeuvre.twist)
    counts = [c.value for c in drive.mileages if begin_ns <= c.received_ns <= drive.ended_ns]
    span_s = (counts[-1].mono_ns - counts[0].mono_ns) / NS_PER_S if counts else 0.0
    if span_s:
        travel = Travel()
        for each in counts:
            travel.add_mileage(each)
        yield "counted", _signed(travel.counted.scaled(1 / span_s), drive.manoeuvre.twist)


def _stop_data(stops: Sequence[Stop], settings: SafetyConfig) -> Iterator[Row]:
    """Yield the figures of a stop; one in a curve has those of both axes."""
    figures: dict[str, list[str]] = {}
    for stop in stops:
        unit = stop.axis.unit
        for name, text in (
            ("reaction", _known(f"{stop.reaction:z.3f} s")),
            ("deceleration", _known(f"{stop.deceleration:.2f} {unit}/s2")),
            ("stop distance", f"{stop.distance:.3f} {unit}"),
            ("needed", f"{needed(stop):.3f} {unit}"),
            ("reckoned", f"{reckoned(stop, settings):.3f} {unit}"),
        ):
            figures.setdefault(name, []).append(text)
    yield from ((name, "; ".join(texts)) for name, texts in figures.items())


def _measured(drive: Drive) -> Twist | None:
    """Return the mean velocity before the end of the requests."""
    begin_ns = drive.ended_ns - round(MEASURED_S * NS_PER_S)
    recent = [v.value for v in drive.velocities if begin_ns <= v.received_ns <= drive.ended_ns]
    if not recent:
        return None
    return Twist(mean(v.linear for v in recent), mean(v.angular for v in recent))


def _fastest(drive: Drive) -> Twist:
    """Return the greatest speed that safety commanded, in the requested direction."""
    runs = [each.value for each in _runs(drive)]
    return Twist(
        max((m.linear for m in runs), key=abs, default=0.0),
        max((m.angular for m in runs), key=abs, default=0.0),
    )


def _runs(drive: Drive) -> list[Latest[Motion]]:
    """Return the commands of motion."""
    return [
        each
        for each in drive.motions
        if each.value.command is Command.RUN
        and not Twist(each.value.linear, each.value.angular).rounds_to_zero
    ]


def _travel(drive: Drive) -> Travel:
    travel = Travel()
    for velocity in drive.velocities:
        travel.add_velocity(velocity.value)
    for mileage in drive.mileages:
        travel.add_mileage(mileage.value)
    return travel


def _at_standstill(drive: Drive, bias: Twist) -> str:
    """Return why it does not stand, or the streams are unsuitable; or an empty string."""
    period_s = median(
        (b.value.mono_ns - a.value.mono_ns) / NS_PER_S for a, b in pairwise(drive.velocities)
    )
    if period_s > COARSEST_S:
        return (
            f"A velocity arrives each {period_s:.2f} s only, too rarely to watch a stop: run "
            "`t2 checkout drive` on the robot, over ssh."
        )
    if not bias.is_standing:
        return (
            f"At standstill the board measures {bias.linear:+.3f} m/s and {bias.angular:+.3f} "
            f"rad/s; below {STANDING_MPS:g} m/s and {STANDING_RADPS:g} rad/s counts as standstill. "
            "Does it roll? Otherwise have the board's velocity corrected."
        )
    if _runs(drive):
        return "Another program drives: end it first."
    return ""


def _known(text: str) -> str:
    return "unknown" if "nan" in text else text


def _signed(twist: Twist, axes: Twist | None = None) -> str:
    """Return a twist as text, with the axes that are requested."""
    asked = axes or twist
    parts = [f"{twist.linear:+.3f} m/s"] if asked.linear else []
    parts += [f"{twist.angular:+.3f} rad/s"] if asked.angular else []
    return "; ".join(parts)


def _values(log: Sequence[Latest[T]]) -> list[T]:
    return [each.value for each in log]


def _up(value: float) -> float:
    return math.ceil(value * 100 - ROUNDING) / 100


def _down(value: float) -> float:
    return math.floor(value * 100 + ROUNDING) / 100
