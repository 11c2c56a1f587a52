"""Conditions: the causes that the inputs raise, independent of any request."""

from collections.abc import Iterator
from typing import Any, TypeVar

from common.freshness import NS_PER_S, Latest, fresh
from services.safety.config import SafetyConfig
from services.safety.core.causes import Observation, Token
from services.safety.core.inputs import Inputs
from services.safety.core.motion_watch import MotionWatch
from services.safety.core.state import State
from t2.messages import CauseName, Driver, Field, Phrase

T = TypeVar("T")

# The bridge ends a hit after three clear samples, so a hit is at least three samples long. Fewer
# lost samples cannot hide it.
LOST_SAMPLES = 3  # between two decisions, at most
# A shorter stall loses no emergency stop: it waits in the session, or the session is opened again.
STALL_S = 1.0


def observe_inputs(
    inputs: Inputs, settings: SafetyConfig, state: State, now_ns: int
) -> Iterator[Observation]:
    """Yield each cause that depends on inputs and state, present or not."""
    judged = state.verdict.judged if state.verdict.judged != (0, 0) else None
    yield _contact(inputs)
    yield Observation("estop", _estop_received(inputs, state))
    yield _estop_reader(inputs, state, now_ns)
    yield _driver("driver_left", "left", inputs.left)
    yield _driver("driver_right", "right", inputs.right)
    yield Observation("leaving", inputs.leaving)
    yield _starting(inputs, settings, state.speed_limits.missing)
    yield from _link(inputs)
    yield _switches(inputs, settings)
    yield _bumper(inputs, settings, judged, now_ns)
    yield _silent(inputs, settings, state, now_ns)
    yield from _motion(state.motion, now_ns)
    yield from state.speed_limits.observations(now_ns)
    conflicts = (*state.arbiter.conflict(now_ns), *state.speed_limits.conflicts(now_ns))
    phrases = (Phrase("two_publishers.of", {"sources": conflicts}),)
    yield Observation("two_publishers", bool(conflicts), phrases=phrases)


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
        return Observation("estop_reader", True, phrases=(Phrase("estop_reader.stalled"),))
    lost = state.estop_connection not in (0, inputs.estop_connection)
    return Observation("estop_reader", lost)


def _stalled(state: State, age_s: float, now_ns: int) -> bool:
    return state.decided_ns is not None and now_ns - state.decided_ns > age_s * NS_PER_S


def _driver(name: CauseName, side: str, latest: Latest[Driver] | None) -> Observation:
    if latest is None:
        return Observation(name, False)
    sample = latest.value
    faulty = bool(sample.bits or sample.faults)
    faults = sample.faults or (f"bits {sample.bits:#x}",)
    phrases = (Phrase("driver.faults", {"side": side, "faults": faults}),)
    return Observation(name, faulty, (sample.boot, sample.seq), phrases)


def _starting(inputs: Inputs, settings: SafetyConfig, keepalives: list[str]) -> Observation:
    needed: dict[str, Latest[Any] | None] = {
        "velocity": inputs.velocity,
        "ultrasonic": inputs.ultrasonic,
        "bumper": inputs.bumper,
        "driver_left": inputs.left,
        "driver_right": inputs.right,
        "link": inputs.link,
    }
    if settings.board.require_switches:
        needed["switches"] = inputs.switches
    missing = [name for name, latest in needed.items() if latest is None]
    if not inputs.estop_connection:
        missing.append("estop")
    elif inputs.estop_path is None:
        missing.append("estop_path")
    phrases = []
    if missing:
        phrases.append(Phrase("starting.missing", {"inputs": tuple(missing)}))
    if keepalives:
        phrases.append(Phrase("starting.keepalives", {"names": tuple(keepalives)}))
    return Observation("starting", bool(phrases), phrases=tuple(phrases))


def _link(inputs: Inputs) -> Iterator[Observation]:
    if inputs.link is None:
        return
    link = inputs.link.value
    yield Observation("link", link.state != "up", phrases=(Phrase(f"link.{link.state}"),))
    phrases = (Phrase("unarmed"), *link.waiting_phrases)
    yield Observation("unarmed", link.state == "up" and not link.armed, phrases=phrases)
    # The bridge stores a latch until safety confirms it, so that a latch survives a restart of
    # safety. The bridge's own boot means a motion that it braked without a safety service.
    due = link.latched_by not in (None, inputs.boot)
    moved = due and link.latched_by == link.boot
    phrases = (Phrase("predecessor.moved"),) if moved else ()
    yield Observation("predecessor", due, phrases=phrases)


def _switches(inputs: Inputs, settings: SafetyConfig) -> Observation:
    if inputs.switches is None or not settings.board.require_switches:
        return Observation("switches", False)
    switches = inputs.switches.value
    verified = switches.ultrasonic_brake is True and switches.bumper_brake is True
    return Observation("switches", not verified)


def _bumper(
    inputs: Inputs, settings: SafetyConfig, judged: Token | None, now_ns: int
) -> Observation:
    if inputs.bumper is None:
        return Observation("bumper", False)
    if not fresh(inputs.bumper, now_ns, settings.times.bumper_age):
        return Observation("bumper", True)
    boot, seq = inputs.bumper.value.boot, inputs.bumper.value.seq
    if judged is not None and boot != judged[0]:
        return Observation("bumper", True, phrases=(Phrase("bumper.restarted"),))
    lost = judged is not None and seq - judged[1] > LOST_SAMPLES
    return Observation("bumper", lost, phrases=(Phrase("bumper.samples"),))


def _silent(inputs: Inputs, settings: SafetyConfig, state: State, now_ns: int) -> Observation:
    # A sample counts from its reception; samples queued during a stall seem new afterwards.
    if _stalled(state, settings.times.bumper_age, now_ns):
        return Observation("silent", True, phrases=(Phrase("silent.stalled"),))
    too_old = {
        "velocity": _is_old(inputs.velocity, settings.times.velocity_age, now_ns),
        "link": _is_old(inputs.link, settings.times.link_age, now_ns),
        "switches": settings.board.require_switches
        and _is_old(inputs.switches, settings.times.switches_age, now_ns),
        "driver_left": _is_old(inputs.left, settings.times.driver_age, now_ns),
        "driver_right": _is_old(inputs.right, settings.times.driver_age, now_ns),
        "estop_path": _is_old(inputs.estop_path, settings.times.estop_path_age, now_ns),
    }
    old = tuple(name for name, is_old in too_old.items() if is_old)
    return Observation("silent", bool(old), phrases=(Phrase("silent.old", {"inputs": old}),))


def _motion(motion: MotionWatch, now_ns: int) -> Iterator[Observation]:
    standstill = motion.standstill
    twist = standstill.displacement.steady
    phrase = Phrase("standstill.unknown")
    if twist is not None:
        fields: dict[str, Field] = {"linear": twist.linear, "angular": twist.angular}
        phrase = Phrase("not_stopping.speed", fields)
    yield Observation("runaway", motion.runs_away)
    yield Observation("uncommanded_motion", standstill.has_left)
    yield Observation("not_stopping", standstill.is_late(now_ns), phrases=(phrase,))


def _is_old(latest: Latest[T] | None, age_s: float, now_ns: int) -> bool:
    """Return whether a stream that had samples has none within ``age_s``."""
    return latest is not None and not fresh(latest, now_ns, age_s)
