"""Conditions: the causes that the inputs raise, independent of any request."""

from collections.abc import Iterator
from typing import Any, TypeVar

from common.freshness import NS_PER_S, Latest, fresh
from services.safety.config import Safety
from services.safety.core.causes import Observation, Token
from services.safety.core.inputs import Inputs
from services.safety.core.motion_watch import MotionWatch
from services.safety.core.state import State
from t2.messages import CauseName, Driver

T = TypeVar("T")

# The bridge ends a hit after three clear samples, so a hit is at least three samples long. Fewer
# lost samples cannot hide it.
LOST_SAMPLES = 3  # between two decisions, at most
ESTOP_PATH = "the emergency stop's path through the router"
MOVED_ALONE = "The vehicle moved without a command while safety was absent."
# Of the polls of the last 0.2 s, ten at the full rate: this many lost ones can hide a hit of 60 ms.
LOST_POLLS = 3
FEW_POLLS = 1  # hysteresis: the cause clears at this number
# A shorter stall loses no emergency stop: it waits in the session, or the session is opened again.
STALL_S = 1.0


def observe_inputs(
    inputs: Inputs, settings: Safety, state: State, now_ns: int
) -> Iterator[Observation]:
    """Yield each cause that depends on inputs and state, present or not."""
    judged = state.verdict.judged if state.verdict.judged != (0, 0) else None
    yield _contact(inputs)
    yield Observation("estop", _estop_received(inputs, state))
    if state.keepalives.names:
        yield state.keepalives.observation(now_ns)
    yield _estop_reader(inputs, state, now_ns)
    yield _driver("driver_left", "left", inputs.left)
    yield _driver("driver_right", "right", inputs.right)
    yield Observation("leaving", inputs.leaving)
    yield _starting(inputs, settings, state.keepalives.missing)
    yield from _link(inputs)
    yield _switches(inputs, settings)
    yield _bumper(inputs, settings, judged, now_ns)
    yield _bumper_lossy(inputs, "bumper_lossy" in state.latches)
    yield _silent(inputs, settings, state, now_ns)
    yield from _motion(state.motion, now_ns)
    yield from state.speed_limits.observations(now_ns)
    conflicts = ", ".join(state.arbiter.conflict(now_ns) + state.speed_limits.conflicts(now_ns))
    text = f"Two publishers use {conflicts}."
    yield Observation("two_publishers", bool(conflicts), text=text)


def _contact(inputs: Inputs) -> Observation:
    bumper = inputs.bumper
    if bumper is None:
        return Observation("contact", False)
    sample = bumper.value
    return Observation("contact", sample.pressed, (sample.boot, sample.seq))


def _estop_received(inputs: Inputs, state: State) -> bool:
    """Return whether an emergency stop was received, by safety or since then by the bridge."""
    waiting = inputs.link.value.estop if inputs.link else None
    return waiting not in (None, state.estop) or inputs.estop


def _estop_reader(inputs: Inputs, state: State, now_ns: int) -> Observation:
    """Observe whether an emergency stop may have been missed."""
    if _stalled(state, STALL_S, now_ns):
        text = "Safety was stalled: an emergency stop may have been missed."
        return Observation("estop_reader", True, text=text)
    lost = state.estop_connection not in (0, inputs.estop_connection)
    return Observation("estop_reader", lost)


def _stalled(state: State, age_s: float, now_ns: int) -> bool:
    return state.decided_ns is not None and now_ns - state.decided_ns > age_s * NS_PER_S


def _driver(name: CauseName, side: str, latest: Latest[Driver] | None) -> Observation:
    if latest is None:
        return Observation(name, False)
    sample = latest.value
    faulty = bool(sample.bits or sample.faults)
    names = ", ".join(sample.faults) or f"bits {sample.bits:#x}"
    text = f"The {side} motor driver reports: {names.replace('_', ' ')}."
    return Observation(name, faulty, (sample.boot, sample.seq), text)


def _starting(inputs: Inputs, settings: Safety, keepalives: list[str]) -> Observation:
    needed: dict[str, Latest[Any] | None] = {
        "velocity": inputs.velocity,
        "ultrasonic": inputs.ultrasonic,
        "bumper": inputs.bumper,
        "left driver": inputs.left,
        "right driver": inputs.right,
        "link": inputs.link,
    }
    if settings.require_switches:
        needed["switches"] = inputs.switches
    missing = [name for name, latest in needed.items() if latest is None]
    if not inputs.estop_connection:
        missing.append("emergency stop")
    elif inputs.estop_path is None:
        missing.append(ESTOP_PATH)
    missing += [f"emergency stop keepalive of {name}" for name in keepalives]
    text = f"Waiting for the first sample of: {', '.join(missing)}."
    return Observation("starting", bool(missing), text=text)


def _link(inputs: Inputs) -> Iterator[Observation]:
    if inputs.link is None:
        return
    link = inputs.link.value
    texts = {"lost": "The link to the board is lost.", "never": "No frame came from the board yet."}
    # 3 equivalent mutants: nobody reads the text of an absent cause.
    yield Observation("link", link.state != "up", text=texts.get(link.state, ""))
    text = f"The bridge is not armed yet: {link.waiting}." if link.waiting else ""
    yield Observation("unarmed", link.state == "up" and not link.armed, text=text)
    # The bridge stores a latch until safety confirms it, so that a latch survives a restart of
    # safety. The bridge's own boot means a motion that it braked without a safety service.
    due = link.latched_by not in (None, inputs.boot)
    text = MOVED_ALONE if due and link.latched_by == link.boot else ""
    yield Observation("predecessor", due, text=text)


def _switches(inputs: Inputs, settings: Safety) -> Observation:
    if inputs.switches is None or not settings.require_switches:
        return Observation("switches", False)
    switches = inputs.switches.value
    verified = switches.ultrasonic_brake is True and switches.bumper_brake is True
    return Observation("switches", not verified)


def _bumper(inputs: Inputs, settings: Safety, judged: Token | None, now_ns: int) -> Observation:
    if inputs.bumper is None:
        return Observation("bumper", False)
    if not fresh(inputs.bumper, now_ns, settings.times.bumper_age):
        return Observation("bumper", True, text="The bumper is not being read.")
    boot, seq = inputs.bumper.value.boot, inputs.bumper.value.seq
    polls = inputs.bumper.value.lost
    if polls > LOST_POLLS:
        return Observation("bumper", True, text=f"{polls} bumper polls of 0.2 s were lost.")
    if judged is not None and boot != judged[0]:
        return Observation("bumper", True, text="The bridge has restarted.")
    lost = judged is not None and seq - judged[1] > LOST_SAMPLES
    return Observation("bumper", lost, text="Samples of the bumper were lost.")


def _bumper_lossy(inputs: Inputs, held: bool) -> Observation:
    # 1 equivalent mutant: a single lost poll is not lossy either.
    polls = inputs.bumper.value.lost if inputs.bumper else 0
    lossy = polls >= LOST_POLLS or (held and polls > FEW_POLLS)
    text = f"Creeping: {polls} bumper polls of 0.2 s were lost."
    return Observation("bumper_lossy", lossy, text=text)


def _silent(inputs: Inputs, settings: Safety, state: State, now_ns: int) -> Observation:
    # A sample counts from its reception; samples queued during a stall seem new afterwards.
    if _stalled(state, settings.times.bumper_age, now_ns):
        text = "Safety was stalled: samples received meanwhile may be old."
        return Observation("silent", True, text=text)
    too_old = {
        "velocity": _is_old(inputs.velocity, settings.times.velocity_age, now_ns),
        "link": _is_old(inputs.link, settings.times.link_age, now_ns),
        "switches": settings.require_switches
        and _is_old(inputs.switches, settings.times.switches_age, now_ns),
        "left driver": _is_old(inputs.left, settings.times.driver_age, now_ns),
        "right driver": _is_old(inputs.right, settings.times.driver_age, now_ns),
        ESTOP_PATH: _is_old(inputs.estop_path, settings.times.estop_path_age, now_ns),
    }
    old = [name for name, is_old in too_old.items() if is_old]
    return Observation("silent", bool(old), text=f"No recent data: {', '.join(old)}.")


def _motion(motion: MotionWatch, now_ns: int) -> Iterator[Observation]:
    standstill = motion.standstill
    twist = standstill.displacement.steady
    text = "Standstill is not confirmed: no velocity is received."
    if twist is not None:
        text = f"The vehicle does not stop: {twist.linear:.2f} m/s, {twist.angular:.2f} rad/s."
    yield Observation("runaway", motion.runs_away)
    yield Observation("uncommanded_motion", standstill.has_left)
    yield Observation("not_stopping", standstill.is_late(now_ns), text=text)


def _is_old(latest: Latest[T] | None, age_s: float, now_ns: int) -> bool:
    """Return whether a stream that had samples has none within ``age_s``."""
    return latest is not None and not fresh(latest, now_ns, age_s)
