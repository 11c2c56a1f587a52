"""Steps of the checkout on the bus, in their order, with the instructions to the operator."""

import shutil
import sys
import termios
import textwrap
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import NamedTuple

from cli.commission.latches import LatchTest, judge_latch
from cli.commission.link import judge_link
from cli.commission.motion import Run, judge_motion
from cli.commission.report import Verdict, failed
from cli.commission.session import CheckoutSession
from cli.commission.sonar import (
    HandDetector,
    Rest,
    judge_sonars,
    obstructions,
    resting_ranges,
)
from cli.commission.texts import ENGLISH, TEXTS, Say
from common import clock
from common.motion import Twist
from common.text import printable
from t2 import keys
from t2.errors import T2Error
from t2.messages import SONAR_NAMES, Command
from t2.patrol_texts import Words
from t2.words import render

LINK_S = 10.0  # some 1000 frames; the ultrasonic ones prove the CRC: zeros have CRC 0 with any CRC
REST_S = 1.0
HAND_S = 60.0  # to walk around the vehicle and hold a hand there
AWAY_S = 20.0
LATCH_S = 2.0
CLEAR_S = 0.3  # the bridge needs three clear samples, and safety three samples of these
SETTLE_S = 0.5  # a repetition of the emergency stop may be on its way
DRIVE_S = 2.0
FORWARD, TURN = Twist(linear=0.1), Twist(angular=0.2)


# --- dialogue ----------------------------------------------------------------------------------


def show(text: str) -> None:
    """Print lines without buffering, wrapped between words on a terminal."""
    print(wrapped(printable(text, "\n")), flush=True)


def wrapped(text: str) -> str:
    """Return lines that fit on the terminal; unchanged for a file or a pipe."""
    if not sys.stdout.isatty():
        return text
    width = shutil.get_terminal_size().columns
    # The terminal itself wraps Chinese, which has no spaces.
    return "\n".join(
        textwrap.fill(line, width) if line.isascii() else line for line in text.split("\n")
    )


def prompt(question: str) -> str:
    """Return one stripped line; input typed before the question is discarded.

    Raise ``T2Error`` at the end of the input.
    """
    if sys.stdin.isatty():
        with suppress(termios.error):
            termios.tcflush(sys.stdin, termios.TCIFLUSH)
    print(question, end=" ", flush=True)
    try:
        line = sys.stdin.readline()
    except UnicodeDecodeError:
        raise T2Error("standard input is no UTF-8: save the answers as UTF-8") from None
    if not line:
        raise T2Error("standard input has ended before all questions were answered")
    return line.removeprefix("\ufeff").strip()  # a file of answers may begin with a mark


def is_phrase(typed: str, name: str) -> bool:
    """Return whether a line is this phrase of the texts, in either language."""
    return typed.casefold().rstrip(" .!。！") in TEXTS[f"phrase.{name}"]


def confirm(fact: str, phrase: str, say: Say = ENGLISH) -> bool:
    """Return whether the operator types the phrase with this name."""
    typed = prompt(say("confirm", fact=fact, phrase=say(f"phrase.{phrase}")))
    return is_phrase(typed, phrase)


def choice(question: str) -> str:
    """Return one line; a phrase that was typed too early or too late counts as Enter."""
    typed = prompt(question)
    return (
        "" if any(is_phrase(typed, each) for each in ("reset", "off_ground", "ground")) else typed
    )


# --- steps --------------------------------------------------------------------------------------


def link(session: CheckoutSession) -> Verdict:
    """Check the link for some seconds."""
    session.mark()
    session.listen(LINK_S)
    if not (links := session.of(keys.LINK)):
        return failed(session.say("link.none"))
    switches = session.of(keys.SWITCHES)
    newest = switches[-1].value if switches else None
    return judge_link([one.value for one in links], newest, session.say)


def sonars(session: CheckoutSession) -> Verdict:
    """Check the eight sonars, one hand position each."""
    say = session.say
    session.mark()
    session.listen(REST_S)
    samples = [one.value for one in session.of(keys.ULTRASONIC)]
    if not samples:
        return failed(say("sonar.none"))
    rest = resting_ranges(samples)
    if problem := obstructions(rest, say):
        return failed(problem)
    found: list[Sequence[str]] = []
    for name, resting in zip(SONAR_NAMES, rest, strict=True):
        found.append(_find(session, rest, name))
        session.so_far = judge_sonars(rest, found, say("incomplete"), say)
        is_missed = resting is not None and not found[-1]
        if is_missed and len(found) < len(rest) and (left := choice(say("sonar.next"))):
            return judge_sonars(rest, found, left, say)
    return judge_sonars(rest, found, say=say)


def _find(session: CheckoutSession, rest: Rest, name: str) -> Sequence[str]:
    """Return the sonars that detect a hand in front of one of them."""
    if rest[SONAR_NAMES.index(name)] is None:
        show(session.say("sonar.is_faulty", sonar=name))
        return ()
    show(session.say("sonar.now", sonar=name, seconds=HAND_S))
    seen = _wait(session, rest, True, HAND_S) or ()
    if seen:
        show(session.say("sonar.seen", sonars=tuple(seen)))
        while _wait(session, rest, False, AWAY_S) is None and not choice(
            session.say("sonar.still")
        ):
            pass
    else:
        show(session.say("sonar.unseen"))
    return seen


def _wait(
    session: CheckoutSession, rest: Rest, hand: bool, timeout_s: float
) -> Sequence[str] | None:
    """Wait for a hand, or for none; return the detecting sonars, or None at the timeout."""
    detector = HandDetector(rest, session.mark())

    def is_so() -> bool:
        samples = session.of(keys.ULTRASONIC)
        for one in samples:
            detector.take(one.value, one.received_ns)
        samples.clear()
        return bool(detector.seen) == hand and detector.settled(clock.now_ns())

    found = session.until(is_so, timeout_s)
    return sorted(detector.seen, key=SONAR_NAMES.index) if found else None


def bumper(session: CheckoutSession) -> Verdict:
    """Check that the strip reports being pressed and free, and the reset."""
    if problem := unlatch(session):
        return failed(problem)
    say = session.say
    session.mark()
    samples = session.of(keys.BUMPER)
    session.until(lambda: samples, LATCH_S)
    if not samples:
        return failed(say("bumper.none"))
    if samples[-1].value.pressed:
        return failed(say("bumper.before"))
    show(say("bumper.now", seconds=HAND_S))
    if not session.until(lambda: samples[-1].value.pressed, HAND_S):
        return failed(say("bumper.no_press"))
    at_ns = next(one.received_ns for one in samples if one.value.pressed)
    session.until(lambda: "contact" in session.latched(), LATCH_S)
    show(say("bumper.let_go"))
    is_gone = session.until(lambda: not samples[-1].value.pressed, HAND_S)
    session.listen(CLEAR_S)
    problem = "" if is_gone else say("bumper.stays")
    return judge_latch(_latch_test(session, "contact", at_ns), problem, say)


def estop(session: CheckoutSession) -> Verdict:
    """Publish an emergency stop, and reset it."""
    if problem := unlatch(session):
        return failed(problem)
    at_ns = session.mark()
    session.order_stop(session.robot)
    session.stop([session.robot])
    session.until(
        lambda: any(one.value.command is Command.BRAKE for one in session.of(keys.MOTION)), LATCH_S
    )
    session.listen(SETTLE_S)
    return judge_latch(_latch_test(session, "estop", at_ns), say=session.say)


def unlatch(session: CheckoutSession) -> str:
    """Reset earlier latches after confirmation; return the problem, or an empty string."""
    latched = session.fresh_state().latched
    if not latched:
        return ""
    say = session.say
    if not confirm(say("latch.before", causes=say.causes(latched)), "reset", say):
        return say("latch.not_reset")
    return session.reset().problem(say)


def _latch_test(session: CheckoutSession, cause: str, at_ns: int) -> LatchTest:
    """Reset the latch; the messages are copied before, because the reset discards them."""
    states, motions = list(session.of(keys.SAFETY)), list(session.of(keys.MOTION))
    return LatchTest(cause, at_ns, states, motions, session.reset())


def move(requested: Twist, session: CheckoutSession) -> Verdict:
    """Drive a motion after the operator's confirmation."""
    if problem := unlatch(session):
        return failed(problem)
    say = session.say
    if not confirm(say("off_ground"), "off_ground", say):
        return failed(say("not_confirmed"))
    settings = session.settings("bridge")
    session.mark()
    show(say("turning"))
    ended_ns = session.drive(requested, DRIVE_S)
    if ended_ns is None:
        return failed(say("not_granted", text=reported(session)))
    run = Run(
        requested=requested,
        unit=str(settings["wire.command_angular_unit"].value),
        feedback=str(settings["wire.feedback_angular_unit"].value),
        ended_ns=ended_ns,
        motions=session.of(keys.MOTION),
        velocities=session.of(keys.VELOCITY),
        mileages=session.of(keys.MILEAGE),
        states=session.of(keys.SAFETY),
        say=say,
    )
    return judge_motion(run)


def reported(session: CheckoutSession) -> str:
    """Return why safety and the bridge grant no motion."""
    state, links = session.state, session.of(keys.LINK)
    text = render(state.phrases, session.language, state.text) if state else session.say("no_state")
    if not links or links[-1].value.armed:
        return text
    link = links[-1].value
    waiting = render(link.waiting_phrases, session.language, link.waiting)
    return session.say("and_bridge", text=text, waiting=waiting)


class Step(NamedTuple):
    """One step of a checkout; ``what`` is the instruction to the operator."""

    name: str
    title: Words
    what: Words
    run: Callable[[CheckoutSession], Verdict]


WHEELS: Words = (
    "Wheels off the ground, a hand on the vehicle's own switch.",
    "车轮离地，手放在车身上的急停开关上。",
)
STEPS = (
    Step(
        "link",
        ("Link", "链路"),
        (
            f"No action needed: it is observed for {LINK_S:g} s.",
            f"无需操作：将观察 {LINK_S:g} 秒。",
        ),
        link,
    ),
    Step(
        "sonar",
        ("Sonars", "超声波传感器"),
        (
            "First stand aside, with 0.8 m free all around. Then hold a hand 0.2 to 0.4 m in front "
            "of the named sonar until it is detected, and take it away.",
            "请先站到一旁，四周留出 0.8 m 空间。然后将手放在所指传感器前方 0.2 至 0.4 m 处，"
            "检测到后请移开。",
        ),
        sonars,
    ),
    Step(
        "bumper",
        ("Bumper", "防撞条"),
        ("Press and release the bumper strip when prompted.", "请按提示压下并松开防撞条。"),
        bumper,
    ),
    Step(
        "estop",
        ("Emergency stop", "急停"),
        ("No action needed: it is published, and reset.", "无需操作：将触发急停，然后复位。"),
        estop,
    ),
    Step(
        "forward",
        ("Forward", "前进"),
        (
            f"{WHEELS[0]} The wheels turn forward at {FORWARD.linear:g} m/s for {DRIVE_S:g} s.",
            f"{WHEELS[1]}车轮将以 {FORWARD.linear:g} m/s 向前转动 {DRIVE_S:g} 秒。",
        ),
        partial(move, FORWARD),
    ),
    Step(
        "turn",
        ("Turn", "转向"),
        (
            f"{WHEELS[0]} The wheels turn as for a left turn on the spot, at "
            f"{TURN.angular:g} rad/s for {DRIVE_S:g} s.",
            f"{WHEELS[1]}车轮将按原地左转的方式以 {TURN.angular:g} rad/s 转动 {DRIVE_S:g} 秒。",
        ),
        partial(move, TURN),
    ),
)
