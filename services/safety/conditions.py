"""What the inputs show by themselves, before anybody asks to move."""

from collections.abc import Iterator
from typing import Any, TypeVar

from common.freshness import NS_PER_S, Latest, fresh
from common.messages import Driver
from services.safety.config import Safety
from services.safety.inputs import Estop, Inputs
from services.safety.latches import Observation, Token
from services.safety.state import State

T = TypeVar("T")

# The bridge needs three clear samples to end a hit, so a hit is at least three samples long: fewer
# lost ones cannot hide it.
LOST_SAMPLES = 3
MOVED_ALONE = "The vehicle moved without a command while safety was absent."
# Of the polls of the last 0.2 s, ten at the full rate: so many may hide a hit of 60 ms.
LOST_POLLS = 3
FEW_POLLS = 1  # the doubt ends there, so that it does not come and go with every sample


def observe_inputs(
    inputs: Inputs, settings: Safety, state: State, now_ns: int
) -> Iterator[Observation]:
    """Yield each cause that inputs raise, present or not, after what the state remembers."""
    tick = (0, now_ns)
    judged = state.verdict.judged if state.verdict.judged != (0, 0) else None
    yield _contact(inputs, tick)
    yield Observation("estop", isinstance(inputs.event, Estop), tick)
    yield Observation("estop_reader", state.reader_was_up and not inputs.reader, tick)
    yield _driver("left", inputs.left, tick)
    yield _driver("right", inputs.right, tick)
    yield Observation("leaving", inputs.leaving, tick)
    yield _starting(inputs, settings, tick)
    yield from _link(inputs, tick)
    yield _switches(inputs, settings, tick)
    yield _bumper(inputs, settings, judged, now_ns)
    yield _bumper_lossy(inputs, "bumper_lossy" in state.latches, tick)
    yield _silent(inputs, settings, state.decided_ns, now_ns)


def _contact(inputs: Inputs, tick: Token) -> Observation:
    bumper = inputs.bumper
    if bumper is None:
        return Observation("contact", False, tick)
    sample = bumper.value
    return Observation("contact", sample.pressed, (sample.boot, sample.seq))


def _driver(side: str, latest: Latest[Driver] | None, tick: Token) -> Observation:
    if latest is None:
        return Observation(f"driver_{side}", False, tick)
    sample = latest.value
    faulty = bool(sample.bits or sample.faults)
    names = ", ".join(sample.faults) or f"bits {sample.bits:#x}"
    text = f"The {side} motor driver reports: {names.replace('_', ' ')}."
    return Observation(f"driver_{side}", faulty, (sample.boot, sample.seq), text)


def _starting(inputs: Inputs, settings: Safety, tick: Token) -> Observation:
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
    if not inputs.reader:
        missing.append("emergency stop")
    text = f"Waiting for the first sample of: {', '.join(missing)}."
    return Observation("starting", bool(missing), tick, text)


def _link(inputs: Inputs, tick: Token) -> Iterator[Observation]:
    if inputs.link is None:
        return
    link = inputs.link.value
    words = {"lost": "The link to the board is lost.", "never": "The board was never heard."}
    yield Observation("link", link.state != "up", tick, words.get(link.state, ""))
    text = f"The bridge does not obey yet: {link.waiting or 'it is not armed'}."
    yield Observation("unarmed", link.state == "up" and not link.armed, tick, text)
    # The bridge remembers a latch until it hears of it from us, so that none dies with its service.
    # Its own boot stands for a motion that it braked while there was no safety service.
    due = link.latched_by not in (None, inputs.boot)
    text = MOVED_ALONE if due and link.latched_by == link.boot else ""
    yield Observation("predecessor", due, tick, text)


def _switches(inputs: Inputs, settings: Safety, tick: Token) -> Observation:
    if inputs.switches is None or not settings.require_switches:
        return Observation("switches", False, tick)
    switches = inputs.switches.value
    verified = switches.ultrasonic_brake is True and switches.bumper_brake is True
    return Observation("switches", not verified, tick)


def _bumper(inputs: Inputs, settings: Safety, judged: Token | None, now_ns: int) -> Observation:
    tick = (0, now_ns)
    if inputs.bumper is None:
        return Observation("bumper", False, tick)
    if not fresh(inputs.bumper, now_ns, settings.bumper_age):
        return Observation("bumper", True, tick, "The bumper is not being read.")
    boot, seq = inputs.bumper.value.boot, inputs.bumper.value.seq
    polls = inputs.bumper.value.lost
    if polls > LOST_POLLS:
        return Observation("bumper", True, tick, f"{polls} bumper polls of 0.2 s were lost.")
    if judged is not None and boot != judged[0]:
        return Observation("bumper", True, tick, "The bridge has started anew.")
    lost = judged is not None and seq - judged[1] > LOST_SAMPLES
    return Observation("bumper", lost, tick, "Samples of the bumper were lost.")


def _bumper_lossy(inputs: Inputs, held: bool, tick: Token) -> Observation:
    polls = inputs.bumper.value.lost if inputs.bumper else 0
    lossy = polls >= LOST_POLLS or (held and polls > FEW_POLLS)
    text = f"Creeping: {polls} bumper polls of 0.2 s were lost."
    return Observation("bumper_lossy", lossy, tick, text)


def _silent(inputs: Inputs, settings: Safety, decided_ns: int | None, now_ns: int) -> Observation:
    # A sample counts from its arrival, and what had to wait for us arrives when we go on.
    if decided_ns is not None and now_ns - decided_ns > settings.bumper_age * NS_PER_S:
        text = "Safety itself was held up: what was heard meanwhile may be old."
        return Observation("silent", True, (0, now_ns), text)
    too_old = {
        "velocity": _is_old(inputs.velocity, settings.velocity_age, now_ns),
        "link": _is_old(inputs.link, settings.link_age, now_ns),
        "switches": settings.require_switches
        and _is_old(inputs.switches, settings.switches_age, now_ns),
        "left driver": _is_old(inputs.left, settings.driver_age, now_ns),
        "right driver": _is_old(inputs.right, settings.driver_age, now_ns),
        "the router, which the emergency stop passes": _is_old(
            inputs.estop_path, settings.estop_path_age, now_ns
        ),
        "a velocity that is a number": inputs.velocity is not None and inputs.measured is None,
    }
    old = [name for name, is_old in too_old.items() if is_old]
    return Observation("silent", bool(old), (0, now_ns), f"Not heard lately: {', '.join(old)}.")


def _is_old(latest: Latest[T] | None, age_s: float, now_ns: int) -> bool:
    """Tell whether a stream that was heard has dried up."""
    return latest is not None and not fresh(latest, now_ns, age_s)
