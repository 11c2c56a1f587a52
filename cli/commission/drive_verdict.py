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
from cli.commission.texts import ENGLISH, Say
from cli.fit.fit import SENSING_S, needed, reckoned
from cli.fit.stops import DRIVING, TURNING, Kind, Stop, counted, find_stops
from cli.fit.streams import COARSEST_S, Streams
from common.freshness import NS_PER_S, Latest
from common.motion import STANDING_MPS, STANDING_RADPS, Twist
from services.safety.config import DECISION_PERIOD_S, SafetyConfig
from t2.messages import (
    Bumper,
    Command,
    Field,
    Health,
    Mileage,
    Motion,
    SafetyState,
    Switches,
    Velocity,
)
from t2.words import render

MEASURED_S = 0.5  # before the end of the requests
RESOLUTION = 0.003  # m or rad: of the counters, which have steps of 1 mm and 0.1 degrees
ROUNDING = 1e-6
RECORDER = "recorder"

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
    say: Say = ENGLISH


@dataclass(frozen=True, slots=True)
class Result:
    """Verdict on a manoeuvre, and what follows when it failed."""

    verdict: Verdict
    then: Then = "again"


def judge_drive(drive: Drive, settings: SafetyConfig) -> Result:
    """Return the verdict on one manoeuvre."""
    stops, reason = _stops(drive)
    data = (*_speeds(drive), *_stop_data(stops, settings, drive.say))
    problem = drive.problem or next(_problems(drive, stops, reason, settings), None)
    if problem:
        return Result(Verdict("failed", problem.text, data), problem.then)
    return Result(Verdict("passed", _travelled(drive), data))


def judge_standstill(drive: Drive) -> Result:
    """Return the verdict on a standstill without requests: bias, noise and drift."""
    velocities, mileages = _values(drive.velocities), _values(drive.mileages)
    if len(velocities) < 2 or len(mileages) < 2:
        return Result(Verdict("failed", drive.say("judge.no_data")), "end")
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
    return Result(Verdict("passed", drive.say("judge.stands"), data))


def writing_recorders(health: Iterable[Health]) -> dict[int, int]:
    """Return ``boot`` and ``host`` of each recorder that writes all messages to a file."""
    counts: dict[int, list[int]] = {}
    hosts: dict[int, int] = {}
    for each in health:
        if each.service == RECORDER:
            counts.setdefault(each.boot, []).append(each.counters.get("recorded", 0))
            hosts[each.boot] = each.host
    return {boot: hosts[boot] for boot, recorded in counts.items() if recorded[-1] > recorded[0]}


def recorder_problem(health: Sequence[Health], host: int, say: Say = ENGLISH) -> str:
    """Return why no recording is complete, or an empty string.

    ``health`` are messages of some seconds, ``host`` is the robot's computer; 0 if unknown.
    """
    if not any(each.service == RECORDER for each in health):
        return say("recorder.none", start=say("recorder.start"))
    writing = writing_recorders(health)
    if not writing:
        return say("recorder.incidents", start=say("recorder.start"))
    if host and host not in writing.values():
        return say("recorder.elsewhere", start=say("recorder.start"))
    return ""


def switches_problem(switches: Switches | None, say: Say = ENGLISH) -> str:
    """Return why the board's own brakes are not confirmed, or an empty string."""
    if switches is not None and switches.ultrasonic_brake and switches.bumper_brake:
        return ""
    return say("drive.switches")


# --- one manoeuvre ------------------------------------------------------------------------------


def _problems(
    drive: Drive, stops: Sequence[Stop], reason: str, settings: SafetyConfig
) -> Iterator[Problem]:
    say = drive.say
    if not drive.stood:
        yield Problem(say("judge.not_stood"), "end")
    if not drive.velocities or not drive.mileages:
        yield Problem(say("judge.no_data"), "end")
    differ = unlike(_travel(drive), say=say)
    yield from filter(None, (_not_granted(drive), _no_motion(drive), differ, _too_slow(drive)))
    if drive.manoeuvre.ending == "slow":
        return
    if reason:
        yield Problem(say("judge.unmeasured", reason=reason), "again")
    elif drive.manoeuvre.ending != stops[0].kind:
        yield Problem(say("judge.other_end", kind=stops[0].kind.upper()), "again")
    yield from filter(None, (_too_long(stop, settings, say) for stop in stops))


def _not_granted(drive: Drive) -> Problem | None:
    wanted, top = drive.manoeuvre.twist, _fastest(drive)
    pairs = (top.linear, wanted.linear), (top.angular, wanted.angular)
    if all(abs(granted) >= FULL * abs(asked) for granted, asked in pairs):
        return None
    began_ns = min((m.received_ns for m in _runs(drive)), default=drive.ended_ns)
    states = (s.value for s in drive.states if began_ns <= s.received_ns <= drive.ended_ns)
    held = [state for state in states if state.verdict != "run"]
    say = drive.say
    texts = list(dict.fromkeys(render(it.phrases, say.language, it.text) for it in held))
    reports = say("judge.reports", text=say.sentences(texts[-3:]))
    granted = say("judge.granted", top=speed(top), wanted=speed(wanted))
    return Problem(say.sentences([granted, reports if texts else say("judge.little")]), "again")


def _no_motion(drive: Drive) -> Problem | None:
    wanted, travel = drive.manoeuvre.twist, _travel(drive)
    expected = drive.manoeuvre.limit
    for unit, asked, counted_, integrated, limit in (
        ("m", wanted.linear, travel.counted.linear, travel.integrated.linear, expected.linear),
        ("rad", wanted.angular, travel.counted.angular, travel.integrated.angular,
         expected.angular),
    ):  # fmt: skip
        if asked and max(abs(counted_), abs(integrated)) < NOTHING * limit:
            about: dict[str, Field] = {"counted": abs(counted_), "unit": unit, "wanted": asked}
            return Problem(drive.say("judge.no_motion", **about), "again")
    return None


def _too_slow(drive: Drive) -> Problem | None:
    """Return the problem of a speed that is not steady, or is far below the granted one."""
    wanted, measured = drive.manoeuvre.twist, _measured(drive)
    if drive.manoeuvre.group == "return":
        return None  # a short way has no steady part
    if measured is None:
        return Problem(drive.say("judge.no_end"), "end")
    for axis, asked, found in (
        ("linear", wanted.linear, measured.linear),
        ("angular", wanted.angular, measured.angular),
    ):
        if asked and abs(found) < (1 - UNLIKE) * abs(asked):
            return Problem(drive.say(f"judge.slow_{axis}", found=found, wanted=asked), "again")
    if drive.is_steady or math.isinf(drive.manoeuvre.steady_s):
        return None
    it = drive.manoeuvre
    about: dict[str, Field] = {"reach": reach(it.limit, drive.say), "seconds": it.seconds}
    return Problem(drive.say("judge.unsteady", **about), "again")


def _too_long(stop: Stop, settings: SafetyConfig, say: Say) -> Problem | None:
    """Return the problem of a stop that took longer than the settings reckon with."""
    unit, body = stop.axis.unit, settings.vehicle
    name, assumed = (
        ("deceleration", body.deceleration)
        if stop.axis is DRIVING
        else ("angular_deceleration", body.angular_deceleration)
    )
    way, allowed = needed(stop), reckoned(stop, settings)
    figures = say("judge.way", speed=stop.speed, unit=unit, way=way, allowed=allowed)
    if way <= allowed + RESOLUTION:
        if not stop.braked:
            return None
        return Problem(say("judge.braked", figures=figures), "slower")
    react = settings.reaction - DECISION_PERIOD_S
    lowest = _deceleration(stop, react)
    changes = []
    if stop.reaction + SENSING_S > react:
        least_s = _up(stop.reaction + SENSING_S)
        changes.append(say("judge.react", least=least_s, now=settings.safety.react))
    if lowest < assumed:
        about: dict[str, Field] = {"most": _down(lowest), "unit": unit, "now": assumed}
        changes.append(say("judge.deceleration", name=name, **about))
    change = say("judge.and").join(changes) or say("judge.either", name=name)
    return Problem(say("judge.long", figures=figures, change=change), "slower")


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
    name = ("both" if asked.angular else "travelled") if asked.linear else "turned"
    return drive.say(f"judge.{name}", linear=way.linear, degrees=math.degrees(way.angular))


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


def _stop_data(stops: Sequence[Stop], settings: SafetyConfig, say: Say) -> Iterator[Row]:
    """Yield the figures of a stop; one in a curve has those of both axes."""
    figures: dict[str, list[str]] = {}
    for stop in stops:
        unit = stop.axis.unit
        for name, text in (
            ("reaction", _known(f"{stop.reaction:z.3f} s", say)),
            ("deceleration", _known(f"{stop.deceleration:.2f} {unit}/s2", say)),
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
        return drive.say("judge.rare", period=period_s)
    if not bias.is_standing:
        limits: dict[str, Field] = {"still": STANDING_MPS, "still_angular": STANDING_RADPS}
        about: dict[str, Field] = {"linear": bias.linear, "angular": bias.angular}
        return drive.say("judge.bias", **about, **limits)
    if _runs(drive):
        return drive.say("judge.driven")
    return ""


def _known(text: str, say: Say) -> str:
    return say("unknown") if "nan" in text else text


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
