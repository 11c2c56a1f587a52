"""Session of the checkout: the client of safety, with a log of all messages since a mark."""

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from statistics import mean
from typing import Any, TypeVar

import msgspec

from cli.commission.drive_verdict import Drive
from cli.commission.latches import Reset
from cli.commission.manoeuvres import Ending, Manoeuvre
from cli.commission.motion import too_fast
from cli.commission.report import Verdict
from cli.commission.supervision import Problem, Supervision
from cli.commission.texts import Say
from cli.inspect.addressing import chunks, decode, topic_of
from cli.inspect.client import SafetyClient
from cli.inspect.session import decoded
from common import clock
from common.bus.inspector import Inspector, inspecting
from common.config import Setting
from common.freshness import NS_PER_S, Latest
from common.motion import Twist
from common.settings import Shared
from t2 import keys
from t2.client import request, reset_request
from t2.codec import Sample
from t2.errors import LinkError, MessageError, T2Error
from t2.keys import Topic
from t2.messages import Message, ResetDone, SafetyState
from t2.words import Language, render

SOURCE = "checkout"  # as in safety's settings
STACK_S = 10.0
READY_S = 8.0  # wait for safety to grant motion; a cause that clears by itself needs 0.5 s
REST_S = 3.0  # wait for standstill after the last request
ZEROS_S = 0.15  # three requests
RESTING_S = 0.5  # of standstill after a manoeuvre, in which the counters settle
RESETS = 8  # in 4 s
WINDOW = 50  # velocities: more than arrive within it
LATE_S = 0.5  # from the end of the lease to the STOP, including a slow bus
LOST_S = 0.3  # without velocities or counters a motion is not supervised
LATCH_S = 1.0  # from an emergency stop to its latch
AGAIN_S = 1.0  # after a reset: for a second stop, of a bumper that is let go or of an operator
ESTOP = "estop"  # the cause, and the event of an operator's emergency stop
TOPICS = (keys.LINK, keys.MOTION, keys.VELOCITY, keys.MILEAGE, keys.ULTRASONIC, keys.BUMPER,
          keys.SWITCHES, keys.DRIVER, keys.HEALTH, keys.EVENTS)  # fmt: skip

M = TypeVar("M", bound=Message)


class CheckoutSession(SafetyClient):
    """One checkout on a bus."""

    def __init__(self, opened: Inspector, robot: str, language: Language = "en") -> None:
        """Listen to the robot; ``language`` is that of safety's texts."""
        super().__init__(opened, robot, SOURCE, language)
        self.say = Say(language)
        self.so_far: Verdict | None = None  # of a step that is not over
        self._marked_ns = 0
        self._braked_ns = 0  # when this manoeuvre's emergency stop was published; 0 without one
        self._ordered = self._seen = 0  # emergency stops published here, and received from anybody
        self._log: defaultdict[str, list[Any]] = defaultdict(list)
        for topic in TOPICS:
            opened.listen(topic.on(robot, side="*", service="*"))
        opened.listen(keys.estop_key(robot))

    @property
    def has_braked(self) -> bool:
        """Whether the last manoeuvre published an emergency stop."""
        return self._braked_ns > 0

    def order_stop(self, robot: str) -> None:
        """Publish an emergency stop once, and count it."""
        self._ordered += 1
        super().order_stop(robot)

    def forget(self) -> None:
        """Discard what has arrived, but count the emergency stops in it."""
        for sample in self.inspector.queued():
            self._count(sample)
        super().forget()

    def mark(self) -> int:
        """Discard everything received until now, queued messages too; return the time."""
        self.forget()
        self._marked_ns = clock.now_ns()
        for log in self._log.values():
            log.clear()
        return self._marked_ns

    def of(self, topic: Topic[M]) -> list[Latest[M]]:
        """Return the messages of a topic since the mark, each with its local receive time."""
        return self._log[topic.path]

    def receive(self, sample: Sample) -> None:
        """Log one message of the bus."""
        self._count(sample)
        super().receive(sample)
        topic = topic_of(sample.key)
        if topic is None or sample.received_ns < self._marked_ns:
            return
        try:
            message = decode(sample, topic.message)
        except MessageError:
            return
        self._log[topic.path].append(Latest(message, sample.received_ns))

    def _count(self, sample: Sample) -> None:
        # Any PUT or DELETE counts; nothing in it shows who has sent it.
        self._seen += chunks(sample.key)[1] == keys.ESTOP_PATH

    def listen(self, seconds: float) -> None:
        """Receive for a time."""
        self.until(lambda: False, seconds)

    def settings(self, service: str) -> dict[str, Setting]:
        """Return a service's settings by path; raise ``LinkError`` without an answer."""
        for answer in self.inspector.query(keys.info_key(self.robot, service, "config")):
            if not answer.refusal:
                return msgspec.json.decode(answer.payload, type=dict[str, Setting])
        raise LinkError(f"cannot read the settings of {service}: it does not answer")

    def latched(self) -> tuple[str, ...]:
        """Return the latched causes of safety's newest state."""
        return self.state.latched if self.state else ()

    def reset(self, seen: SafetyState | None = None) -> Reset:
        """Request a reset of the causes latched in ``seen``, and return what is latched after it.

        Without ``seen`` these are the causes that are latched now. A second stop shortly after the
        reset is waited for.
        """
        requested_ns = clock.now_ns()
        try:
            seen = seen or self.fresh_state()
            requested_ns = self.mark()
            answers = self.call(keys.RESET, reset_request(seen))
            if not self.is_reset(seen, answers):
                raise T2Error("safety's state does not show it")
        except T2Error as error:
            return Reset(requested_ns, False, str(error), self.latched())
        self.until(self.latched, AGAIN_S)
        done = decoded(answers, ResetDone)
        text = " ".join(render(one.phrases, self.language, one.text) for one in done)
        return Reset(requested_ns, True, text, self.latched())

    def drive(self, requested: Twist, seconds: float) -> int | None:
        """Request a motion, then zero until the vehicle stands.

        Return the time at which zero was first requested; None if safety did not grant motion, or
        has latched before.
        """
        try:
            if not self._becomes_ready():
                return None
            self.requested = request(requested.linear, requested.angular)
            self.until(lambda: self._must_stop(requested), seconds)
            ended_ns = clock.now_ns()
            self.requested = request()
            self.until(lambda: self._stands(ended_ns), REST_S)
            return ended_ns
        finally:
            self._let_go()

    def perform(self, it: Manoeuvre, lease_s: float, stop_s: float) -> Drive | None:
        """Carry out a manoeuvre, from standstill to standstill, under supervision.

        ``lease_s`` is that of the checkout, ``stop_s`` the longest stop from its command on.
        Ctrl-C publishes an emergency stop. Return None if safety did not grant motion.
        """
        self.mark()
        self._braked_ns = self._ordered = self._seen = 0
        try:
            if not self._becomes_ready():
                return None
            problem, is_steady = self._move(it)
            ended_ns = clock.now_ns()
            late = self._end(it.ending if problem is None else problem.ending, lease_s)
            stood = self._comes_to_rest(ended_ns, stop_s)
        except KeyboardInterrupt:
            self._brake()
            raise
        finally:
            self._let_go()
        problem = problem or late or self._taken_over()
        return self._drive_of(it, ended_ns, stood, is_steady, problem)

    def observe(self, it: Manoeuvre) -> Drive:
        """Watch a standstill without any request."""
        self.mark()
        self.listen(it.seconds)
        return self._drive_of(it, clock.now_ns(), True, True, None)

    def reset_own_stop(self) -> str:
        """Reset the emergency stop of the last manoeuvre, and no other cause.

        Return why it stays latched, or an empty string. An operator may have pressed an emergency
        stop, too: safety has one latch for both. Theirs shows in the number of emergency stops.
        """
        own = [
            cause.id
            for state in self.of(keys.SAFETY)
            if state.received_ns >= self._braked_ns
            for cause in state.value.causes
            if cause.name == ESTOP
        ]
        events = (event.value for event in self.of(keys.EVENTS))
        if any(event.name == ESTOP and "by" in event.about for event in events):
            return self.say("end.pressed")
        for attempt in range(RESETS):
            seen = self.fresh_state()
            if problem := self._not_own(seen, own[:1]):
                return problem
            done = self.reset(seen)
            if done.granted or attempt == RESETS - 1:
                break
            self.listen(RESTING_S)  # safety refuses it while noise looks like motion
        if done.granted and self._seen > self._ordered:  # pressed during the reset, or after it
            self.emergency_stop()
            return self.say("end.pressed")
        return done.problem(self.say)

    def _not_own(self, seen: SafetyState, own: list[int]) -> str:
        """Return why what is latched is not, or not only, its own emergency stop."""
        if taken := self._taken_over():
            return taken.text
        self.until(lambda: self._seen >= self._ordered, LATCH_S)
        if self._seen > self._ordered:
            return self.say("end.pressed")
        if self._seen < self._ordered:
            return self.say("end.not_received")
        if not own or [cause.id for cause in seen.causes if cause.name in seen.latched] != own:
            return self.say("end.latched", causes=self.say.causes(seen.latched))
        return ""

    def emergency_stop(self) -> bool:
        """Publish an emergency stop; return whether safety shows it as latched within a second."""
        self._brake()
        with suppress(KeyboardInterrupt):  # another Ctrl-C
            self.forget()
            self.until(lambda: ESTOP in self.latched(), LATCH_S)
        return ESTOP in self.latched()

    def _becomes_ready(self) -> bool:
        """Request zero until safety grants motion; return whether it does, with no latch."""
        self.requested = request()
        self.until(lambda: self.latched() or self._is_granted(), READY_S)
        return not self.latched() and self._is_granted()

    def _move(self, it: Manoeuvre) -> tuple[Problem | None, bool]:
        """Request the motion until it is over.

        Return what contradicts it, if anything does, and whether it reached a steady speed.
        """
        supervision, began_ns = Supervision(it, say=self.say), clock.now_ns()
        logs = self.of(keys.MOTION), self.of(keys.VELOCITY), self.of(keys.MILEAGE)
        found: list[Problem] = []

        def is_over() -> bool:
            if problem := self._interference() or self._lost(began_ns):
                found.append(problem)
            elif supervision.take(*logs):
                if problem := supervision.problem():
                    found.append(problem)
                return bool(found) or supervision.is_at_limit or supervision.is_steady(logs[1])
            return bool(found)

        self.requested = request(it.twist.linear, it.twist.angular)
        self.until(is_over, it.seconds)
        return found[0] if found else None, supervision.is_steady(logs[1])

    def _interference(self) -> Problem | None:
        """Return why safety does not let the checkout drive on."""
        state = self.state
        if state is None or (state.source == SOURCE and state.verdict in ("run", "slow")):
            return None
        if taken := self._taken_over():
            return taken
        text = render(state.phrases, self.language, state.text)
        return Problem(self.say("end.stopped", text=text), "again", "slow")

    def _lost(self, began_ns: int) -> Problem | None:
        """Return the problem of velocities or counters that no longer arrive here."""
        for name, log in (
            ("velocity", self.of(keys.VELOCITY)),
            ("counters", self.of(keys.MILEAGE)),
        ):
            newest_ns = max(log[-1].received_ns, began_ns) if log else began_ns
            if clock.now_ns() - newest_ns > LOST_S * NS_PER_S:
                return Problem(self.say(f"end.lost_{name}", seconds=LOST_S), "again")
        return None

    def _taken_over(self) -> Problem | None:
        """Return the problem of another source that drives: it is left alone."""
        source = self.state.source if self.state else None
        if source in (None, SOURCE):
            return None
        return Problem(self.say("end.other", source=source), "again", "slow")

    def _end(self, ending: Ending, lease_s: float) -> Problem | None:
        """End the motion; without STOP after the lease by an emergency stop, and a problem."""
        if self._taken_over():
            self.requested = None
        elif ending == "stop":
            self.fall_silent()
            self.until(lambda: self._taken_over() or self._is_stopped(), lease_s + LATE_S)
            if not self._is_stopped() and not self._taken_over():
                self._brake()
                return Problem(self.say("end.no_stop", source=SOURCE), "end")
        elif ending == "brake":
            self._brake()
        else:
            self.requested = request()
        return None

    def _comes_to_rest(self, ended_ns: int, stop_s: float) -> bool:
        """Wait for standstill, which an emergency stop enforces; return whether it came in time.

        Return False at once when another source drives: its vehicle is not stopped.
        """
        self.until(lambda: self._taken_over() or self._rests(ended_ns), stop_s)
        if self._taken_over():
            return False
        stood = self._rests(ended_ns)
        if not stood:
            self._brake()
            braked_ns = clock.now_ns()
            self.until(lambda: self._taken_over() or self._rests(braked_ns), REST_S)
        return stood

    def _brake(self) -> None:
        """Publish an emergency stop, at first at once, then until safety has latched it."""
        self._braked_ns = self._braked_ns or clock.now_ns()
        self.order_stop(self.robot)
        self.begin_stop([self.robot])
        self.requested = None

    def _let_go(self) -> None:
        # On every way out: zeros, the first one at once. The silence after them is letting go.
        self.requested = None
        self.tick()
        self.listen(ZEROS_S)

    def _drive_of(
        self,
        it: Manoeuvre,
        ended_ns: int,
        stood: bool,
        is_steady: bool,
        problem: Problem | None,
    ) -> Drive:
        """Return the manoeuvre with copies of the logs, which the next one clears."""
        return Drive(
            it,
            ended_ns,
            stood,
            list(self.of(keys.MOTION)),
            list(self.of(keys.VELOCITY)),
            list(self.of(keys.MILEAGE)),
            list(self.of(keys.BUMPER)),
            list(self.of(keys.SAFETY)),
            is_steady,
            problem,
            self.say,
        )

    def _is_granted(self) -> bool:
        if not self.state or not self.of(keys.LINK):
            return False
        link = self.of(keys.LINK)[-1].value
        return self.state.source == SOURCE and self.state.verdict in ("run", "slow") and link.armed

    def _must_stop(self, requested: Twist) -> bool:
        velocities = self.of(keys.VELOCITY)
        fast = bool(velocities) and too_fast(requested, velocities[-1].value)
        return fast or bool(self.latched())

    def _is_stopped(self) -> bool:
        """Return whether safety commands standstill."""
        motions = self.of(keys.MOTION)
        newest = motions[-1].value if motions else None
        return newest is None or Twist(newest.linear, newest.angular).rounds_to_zero

    def _rests(self, since_ns: int) -> bool:
        """Return whether the vehicle has stood for a while, by a mean: velocities are noisy."""
        begin_ns = max(since_ns, clock.now_ns() - round(RESTING_S * NS_PER_S))
        recent = [v for v in self.of(keys.VELOCITY)[-WINDOW:] if v.received_ns >= begin_ns]
        if not recent or recent[-1].received_ns < since_ns + RESTING_S * NS_PER_S:
            return False
        return (
            self._is_stopped()
            and Twist(
                mean(v.value.linear for v in recent), mean(v.value.angular for v in recent)
            ).is_standing
        )

    def _stands(self, since_ns: int) -> bool:
        velocities = self.of(keys.VELOCITY)
        if not velocities or velocities[-1].received_ns < since_ns + NS_PER_S // 4:
            return False
        newest = velocities[-1].value
        return Twist(newest.linear, newest.angular).is_standing


@contextmanager
def checkout_session(config: Shared, language: Language = "en") -> Iterator[CheckoutSession]:
    """Open a session for the context; raise ``LinkError`` without a stack."""
    with inspecting(config.bus) as opened:
        session = CheckoutSession(opened, config.robot.id, language)
        if not session.until(lambda: session.of(keys.LINK) and session.state, STACK_S):
            raise LinkError(
                f"no message of bridge and safety of robot {config.robot.id} on "
                f"{', '.join(config.bus.endpoints)}; run {opened.doctor}, or start "
                "`t2 up --no-sim --config config/vehicle.toml` first"
            )
        yield session
