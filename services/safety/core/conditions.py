"""Conditions: the causes that the inputs show, independent of any request."""

from collections.abc import Iterator
from typing import Any

from common.freshness import NS_PER_S, Latest, fresh
from services.safety.config import SafetyConfig, TimeLimits
from services.safety.core.causes import Observation, Token
from services.safety.core.inputs import Inputs
from services.safety.core.motion_watch import MotionWatch
from services.safety.core.state import State
from t2.messages import Bumper, CauseName, Driver, Field, Phrase

# The bridge ends a hit after three clear samples, so a hit is at least three samples long. Fewer
# lost samples cannot hide it.
LOST_SAMPLES = 3  # between two decisions, at most
# A shorter stall loses no emergency stop: it waits in the session, or the session is opened again.
STALL_S = 1.0


def observe_inputs(
    inputs: Inputs, settings: SafetyConfig, state: State, now_ns: int
) -> list[Observation]:
    """Return the causes that inputs and state show."""
    times = settings.times
    judged = state.verdict.judged if state.verdict.judged != (0, 0) else None
    shown = (
        _if(inputs.is_pressed, "contact"),
        _if(_estop_received(inputs, state), "estop"),
        _estop_reader(inputs, state, now_ns),
        _driver("driver_left", "left", inputs.left),
        _driver("driver_right", "right", inputs.right),
        _if(inputs.leaving, "leaving"),
        _starting(inputs, settings, state.speed_limits.missing),
        *_link(inputs),
        _switches(inputs, settings),
        _bumper(inputs, times, judged, now_ns),
        _silent(inputs, settings, state, now_ns),
        *_motion(state.motion, now_ns),
        *state.speed_limits.observations(now_ns),
        _two_publishers(state, now_ns),
    )
    return [one for one in shown if one]


def samples(inputs: Inputs) -> dict[CauseName, Token]:
    """Return the tokens of the samples that show a cause or not."""
    streams: dict[CauseName, Latest[Bumper] | Latest[Driver] | None] = {
        "contact": inputs.bumper,
        "driver_left": inputs.left,
        "driver_right": inputs.right,
    }
    return {name: (it.value.boot, it.value.seq) for name, it in streams.items() if it}


def _if(shown: bool, name: CauseName, *phrases: Phrase) -> Observation | None:
    return Observation(name, phrases) if shown else None


def _estop_received(inputs: Inputs, state: State) -> bool:
    """Return whether an emergency stop was received, by safety or since then by the bridge."""
    waiting = inputs.link.value.estop if inputs.link else None
    return waiting not in (None, state.estop) or inputs.estop


def _estop_reader(inputs: Inputs, state: State, now_ns: int) -> Observation | None:
    """Observe whether an emergency stop may have been missed."""
    if _stalled(state, STALL_S, now_ns):
        return Observation("estop_reader", (Phrase("estop_reader.stalled"),))
    return _if(state.estop_connection not in (0, inputs.estop_connection), "estop_reader")


def _stalled(state: State, age_s: float, now_ns: int) -> bool:
    return state.decided_ns is not None and now_ns - state.decided_ns > age_s * NS_PER_S


def _driver(name: CauseName, side: str, latest: Latest[Driver] | None) -> Observation | None:
    if latest is None or not latest.value.has_fault:
        return None
    faults = latest.value.faults or (f"bits {latest.value.bits:#x}",)
    return Observation(name, (Phrase("driver.faults", {"side": side, "faults": faults}),))


def _starting(inputs: Inputs, settings: SafetyConfig, keepalives: list[str]) -> Observation | None:
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
    return _if(bool(phrases), "starting", *phrases)


def _link(inputs: Inputs) -> Iterator[Observation]:
    if inputs.link is None:
        return
    link = inputs.link.value
    if link.state != "up":
        yield Observation("link", (Phrase(f"link.{link.state}"),))
    elif not link.armed:
        yield Observation("unarmed", (Phrase("unarmed"), *link.waiting_phrases))
    # The bridge stores a latch until safety confirms it, so that a latch survives a restart of
    # safety. The bridge's own boot means a motion that it braked without a safety service.
    if link.latched_by not in (None, inputs.boot):
        moved = link.latched_by == link.boot
        yield Observation("predecessor", (Phrase("predecessor.moved"),) if moved else ())


def _switches(inputs: Inputs, settings: SafetyConfig) -> Observation | None:
    if inputs.switches is None or not settings.board.require_switches:
        return None
    switches = inputs.switches.value
    verified = switches.ultrasonic_brake is True and switches.bumper_brake is True
    return _if(not verified, "switches")


def _bumper(
    inputs: Inputs, times: TimeLimits, judged: Token | None, now_ns: int
) -> Observation | None:
    if inputs.bumper is None:
        return None
    if not fresh(inputs.bumper, now_ns, times.bumper_age):
        return Observation("bumper")
    boot, seq = inputs.bumper.value.boot, inputs.bumper.value.seq
    if judged is not None and boot != judged[0]:
        return Observation("bumper", (Phrase("bumper.restarted"),))
    lost = judged is not None and seq - judged[1] > LOST_SAMPLES
    return _if(lost, "bumper", Phrase("bumper.samples"))


def _silent(
    inputs: Inputs, settings: SafetyConfig, state: State, now_ns: int
) -> Observation | None:
    times, needs_switches = settings.times, settings.board.require_switches
    # A sample counts from its reception; samples queued during a stall seem new afterwards.
    if _stalled(state, times.bumper_age, now_ns):
        return Observation("silent", (Phrase("silent.stalled"),))
    limits: tuple[tuple[str, Latest[Any] | None, float], ...] = (
        ("velocity", inputs.velocity, times.velocity_age),
        ("link", inputs.link, times.link_age),
        ("switches", inputs.switches if needs_switches else None, times.switches_age),
        ("driver_left", inputs.left, times.driver_age),
        ("driver_right", inputs.right, times.driver_age),
        ("estop_path", inputs.estop_path, times.estop_path_age),
    )
    old = [name for name, latest, age_s in limits if latest and not fresh(latest, now_ns, age_s)]
    return _if(bool(old), "silent", Phrase("silent.old", {"inputs": tuple(old)}))


def _motion(motion: MotionWatch, now_ns: int) -> Iterator[Observation]:
    standstill = motion.standstill
    if motion.runs_away:
        yield Observation("runaway")
    if standstill.has_left:
        yield Observation("uncommanded_motion")
    if standstill.is_late(now_ns):
        twist = standstill.displacement.steady
        phrase = Phrase("standstill.unknown")
        if twist is not None:
            fields: dict[str, Field] = {"linear": twist.linear, "angular": twist.angular}
            phrase = Phrase("not_stopping.speed", fields)
        yield Observation("not_stopping", (phrase,))


def _two_publishers(state: State, now_ns: int) -> Observation | None:
    conflicts = (*state.arbiter.conflict(now_ns), *state.speed_limits.conflicts(now_ns))
    return _if(
        bool(conflicts), "two_publishers", Phrase("two_publishers.of", {"sources": conflicts})
    )
