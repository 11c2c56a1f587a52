"""The guided drive on the shipped services and the simulated vehicle, in simulated time."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import pytest
from msgspec.structs import replace

from cli.commission import drive_command, steps
from cli.commission.drive_command import GuidedDrive, guided_drive
from cli.commission.manoeuvres import Group, Manoeuvre, plan
from cli.commission.report import Report, render
from cli.commission.session import CheckoutSession
from cli.fit.stops import find_stops
from cli.fit.streams import Streams
from common.config import build
from common.freshness import NS_PER_S, Latest
from services.safety.config import SafetyConfig
from sim.model import Drive, Model
from sim.requests import Bumper
from t2 import keys
from t2 import messages as m
from t2.errors import T2Error
from tests.cli.commission.simulated_session import STEP_MS, SimulatedInspector, simulated_session

pytestmark = pytest.mark.simulated

SKIPPED = "no room there"


@dataclass
class Operator:
    """The person who answers, and everything that is shown."""

    shown: list[str]
    answers: Callable[[str], str] = lambda question: ""

    def prompt(self, question: str) -> str:
        self.shown.append(question)
        return self.answers(question)

    @property
    def text(self) -> str:
        return "\n".join(self.shown)


@dataclass
class Fixture:
    """A guided drive on a simulated stack."""

    drive: GuidedDrive
    inspector: SimulatedInspector
    operator: Operator

    @property
    def session(self) -> CheckoutSession:
        return self.drive.session

    @property
    def speed(self) -> float:
        return abs(self.inspector.stack.vehicle.truth.linear)

    def run(self, *titles: str, returns: bool = False) -> list[str]:
        """Carry out these manoeuvres, or all; return the outcome of each."""
        manoeuvres = [it for it in plan(self.drive.settings) if not titles or it.title in titles]
        assert len(manoeuvres) >= len(titles)
        self.drive.run(manoeuvres, returns=returns)
        assert self.inspector.stack.oracle.violations == []
        return self.outcomes

    @property
    def outcomes(self) -> list[str]:
        return [verdict.outcome for _, verdict in self.drive.report.manoeuvres]

    @property
    def finding(self) -> str:
        """The text of the newest verdict."""
        return self.drive.report.manoeuvres[-1][1].text

    def when(self, speed: float, do: Callable[[], object]) -> None:
        """Do something once, when the vehicle is so fast."""

        def each_step() -> None:
            if self.speed > speed:
                self.inspector.each_step = lambda: None
                do()

        self.inspector.each_step = each_step


@contextmanager
def driving(
    monkeypatch: pytest.MonkeyPatch, model: Model | None = None, answers: Any = lambda _: ""
) -> Iterator[Fixture]:
    operator = Operator([], answers)
    for module in (steps, drive_command):
        monkeypatch.setattr(module, "prompt", operator.prompt)
        monkeypatch.setattr(module, "show", operator.shown.append)
    with simulated_session(model or Model()) as (session, inspector):
        settings = build(SafetyConfig, session.settings("safety"))
        report = Report(robot="001", date="", facts=[], settings=[])
        drive = GuidedDrive(session, report, settings, unrecorded=True)
        yield Fixture(drive, inspector, operator)


def recorded(inspector: SimulatedInspector) -> Streams:
    """Record the streams that show stops, from now on."""
    streams = Streams()
    process = inspector.stack.process("recorder")
    for topic in (keys.MOTION, keys.VELOCITY, keys.MILEAGE, keys.BUMPER):
        process.subscribe(topic, lambda arrival: streams.add(arrival.message))
    return streams


def test_the_whole_plan_is_driven_and_shows_every_kind_of_stop(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with driving(monkeypatch) as it:
        streams = recorded(it.inspector)
        begin, begin_ns = it.inspector.stack.vehicle.truth, it.inspector.stack.net.now_ns
        outcomes = it.run(returns=True)
        assert outcomes == ["passed"] * len(plan(it.drive.settings)), it.operator.text
        minutes = (it.inspector.stack.net.now_ns - begin_ns) / NS_PER_S / 60
        assert minutes < 4
        end = it.inspector.stack.vehicle.truth
        assert (end.x, end.y) == pytest.approx((begin.x, begin.y), abs=0.15)
        assert not it.session.latched()
        assert "still missing" not in it.operator.text
    stops, left_out = find_stops(streams)
    assert not left_out
    for kind, number in (("stop", 6), ("brake", 3)):
        for direction in ("forward", "backward", "left", "right"):
            found = [s.speed for s in stops if (s.kind, s.direction) == (kind, direction)]
            assert len(found) >= number
            assert max(found) == pytest.approx(0.8, abs=0.01)
    report = render(it.drive.report)
    assert "| STOP backward from 0.80 m/s | -0.800 m/s | -0.800 m/s | -0.800 m/s |" in report


def test_a_stop_that_is_too_long_ends_the_rising_series(monkeypatch: pytest.MonkeyPatch) -> None:
    weak = Model(drive=Drive(coast=0.3))
    titles = [f"STOP {way} from {speed} m/s" for speed in ("0.20", "0.45", "0.50")
              for way in ("forward", "backward")]  # fmt: skip
    with driving(monkeypatch, weak) as it:
        outcomes = it.run(*titles, "STOP left from 0.80 rad/s")
        assert outcomes == ["failed", "failed", *["skipped"] * 4, "passed"], it.operator.text
        text = it.drive.report.manoeuvres[0][1].text
        assert text.startswith("The stop was too long: from 0.20 m/s it needs 0.09")
        assert "Do not drive faster: set vehicle.deceleration to at most 0.30 m/s2" in text
        assert "Stops that are still missing for a fit: STOP forward: 6 of 6; " in it.operator.text


def negated(message: m.Message) -> m.Message:
    if isinstance(message, m.Velocity):
        return replace(message, linear=-message.linear)
    return message


def halved(message: m.Message) -> m.Message:
    if isinstance(message, m.Mileage):
        return replace(message, distance=message.distance / 2)
    return message


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (negated, "Wrong sign: by the velocities it has travelled -0.0"),
        (halved, "Counters and velocities differ by "),
    ],
)
def test_a_contradiction_stops_the_vehicle_and_ends_the_drive(
    change: Callable[[m.Message], m.Message], text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with driving(monkeypatch) as it:
        it.inspector.change = change
        with pytest.raises(T2Error, match=r"STOP forward from 0.80 m/s: "):
            it.run("STOP forward from 0.80 m/s", "STOP backward from 0.80 m/s")
        assert it.outcomes == ["failed"]
        assert text in it.finding
        assert it.speed == 0
        assert it.session.fresh_state().latched == ("estop",)  # not planned: an operator resets it
        assert "The emergency stop stays latched. It was not planned" in it.finding
        assert "`t2 drive` can reset it" in it.finding


def test_an_emergency_stop_of_an_operator_is_not_reset(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = iter(["", "go on"])
    with driving(monkeypatch, answers=lambda _: next(answers)) as it:
        it.when(0.3, it.inspector.stack.estop)
        assert it.run("STOP forward from 0.50 m/s") == ["failed"]
        assert it.finding.startswith("Safety stopped it: ")
        assert it.session.fresh_state().latched == ("estop",)


def press(it: Fixture) -> None:
    """Press the emergency stop of a screen, which reports who has pressed it."""
    stack = it.inspector.stack
    event = m.Event(name="estop", level="warning", text="", about={"by": "ada"})
    it.inspector.process.post(keys.EVENTS.on("001", service="teleop"), event)
    stack.estop()


def unnamed(it: Fixture) -> None:
    """Press an emergency stop that no event reports, as a program with Zenoh alone does."""
    it.inspector.stack.estop()


@pytest.mark.parametrize("stop", [press, unnamed])
@pytest.mark.parametrize("after_ms", [0, 20, 50, 200, 400])
def test_its_own_latch_stays_when_an_operator_has_pressed_too(
    after_ms: int, stop: Callable[[Fixture], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = iter(["", "go on", "", "reset", ""])  # the reset confirms no motion
    with driving(monkeypatch, answers=lambda _: next(answers)) as it:
        waited_ms = 0

        def once_latched() -> None:
            nonlocal waited_ms
            if it.session.latched() == ("estop",):
                waited_ms += STEP_MS
                if waited_ms > after_ms:
                    it.inspector.each_step = lambda: None
                    stop(it)

        it.inspector.each_step = once_latched
        assert it.run("BRAKE forward from 0.50 m/s") == ["failed"]
        assert "The emergency stop stays latched. Another emergency stop has" in it.finding
        assert it.session.fresh_state().latched == ("estop",)
        # The next manoeuvre asks for the reset, and then for the motion.
        assert it.run("BRAKE backward from 0.50 m/s")[-1] == "passed"
        assert list(answers) == []


@pytest.mark.parametrize("stop", [press, unnamed])
@pytest.mark.parametrize("after_ms", [0, 100, 500, 900])
def test_a_stop_shortly_after_its_own_reset_is_of_this_manoeuvre(
    after_ms: int, stop: Callable[[Fixture], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = iter(["", "go on"])
    with driving(monkeypatch, answers=lambda _: next(answers)) as it:
        was_latched, since_ms = False, 0

        def once_reset() -> None:
            nonlocal was_latched, since_ms
            latched = it.session.latched() == ("estop",)
            was_latched = was_latched or latched
            if was_latched and not latched and it.session.states:
                since_ms += STEP_MS
                if since_ms > after_ms:
                    it.inspector.each_step = lambda: None
                    stop(it)

        it.inspector.each_step = once_reset
        assert it.run("BRAKE forward from 0.50 m/s") == ["failed"]
        assert "The emergency stop stays latched. Another emergency stop has" in it.finding
        assert it.session.fresh_state().latched == ("estop",)


def test_its_own_latch_stays_when_emergency_stops_are_not_received(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    answers = iter(["", "go on"])
    with driving(monkeypatch, answers=lambda _: next(answers)) as it:
        monkeypatch.setattr(it.session, "_count", lambda sample: None)
        assert it.run("BRAKE forward from 0.50 m/s") == ["failed"]
        assert "Its own emergency stops are not received back" in it.finding
        assert it.session.fresh_state().latched == ("estop",)


def test_another_source_ends_the_attempts_to_reset(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = iter(["", "go on"])
    with driving(monkeypatch, answers=lambda _: next(answers)) as it:
        real = it.session.fresh_state

        def of_teleop() -> m.SafetyState:
            braked = it.session.has_braked
            it.session.states["001"] = state = replace(
                real(), source="teleop" if braked else "checkout"
            )
            return state

        monkeypatch.setattr(it.session, "fresh_state", of_teleop)
        assert it.run("BRAKE forward from 0.50 m/s") == ["failed"]
        assert "stays latched. Another source drives, teleop" in it.finding
        assert real().latched == ("estop",)


def test_another_source_that_takes_over_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = iter(["", "go on"])
    with driving(monkeypatch, answers=lambda _: next(answers)) as it:
        latched, steps_since = set[str](), 0

        def take_over() -> None:
            nonlocal steps_since
            latched.update(it.session.latched())
            steps_since += steps_since > 0 or it.speed > 0.3
            if steps_since:
                speed = 0.0 if steps_since < 12 else 0.3  # neutral first
                teleop = it.inspector.stack.sources["teleop"]
                teleop.message = m.Drive(echo=0, linear=speed, angular=0.0)

        it.inspector.each_step = take_over
        assert it.run("STOP forward from 0.50 m/s") == ["failed"]
        assert it.finding.startswith("Another source drives, teleop: end it first.")
        it.session.listen(3.0)
        assert not latched
        assert it.speed == pytest.approx(0.3, abs=0.01)


def test_a_run_that_goes_on_after_the_last_request_ends_the_drive(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    answers = iter(["", "go on", "no"])
    with driving(monkeypatch, answers=lambda _: next(answers)) as it:
        monkeypatch.setattr(it.session, "fall_silent", lambda: None)
        with pytest.raises(T2Error, match="No STOP followed the end of its requests"):
            it.run("STOP forward from 0.50 m/s", "STOP backward from 0.50 m/s")
        assert it.outcomes == ["failed"]
        assert it.speed == 0
        assert it.session.fresh_state().latched == ("estop",)


def test_a_contact_ends_a_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = iter(["", "go on"])
    with driving(monkeypatch, answers=lambda _: next(answers)) as it:
        it.when(0.3, lambda: it.inspector.stack.vehicle.inject(Bumper(pressed=True)))
        assert it.run("BRAKE forward from 0.50 m/s") == ["failed"]
        assert "The bumper" in it.finding
        assert it.session.fresh_state().latched == ("contact",)


def interrupt(*_: object) -> None:
    raise KeyboardInterrupt


def while_it_moves(it: Fixture) -> None:
    it.when(0.3, interrupt)


def at_standstill(it: Fixture) -> None:
    begin_ns = it.inspector.stack.net.now_ns

    def each_step() -> None:
        if it.inspector.stack.net.now_ns > begin_ns + 5 * NS_PER_S:
            it.inspector.each_step = lambda: None
            interrupt()

    it.inspector.each_step = each_step


def at_the_first_question(it: Fixture) -> None:
    it.operator.answers = interrupt  # type: ignore[assignment]


def at_the_second_question(it: Fixture) -> None:
    questions: list[str] = []

    def answer(question: str) -> str:
        questions.append(question)
        if len(questions) == 2:
            interrupt()
        return ""

    it.operator.answers = answer


def after_the_motion(it: Fixture) -> None:
    it.session._let_go = interrupt  # type: ignore[method-assign]


@pytest.mark.parametrize(
    ("moment", "titles", "outcomes"),
    [
        (while_it_moves, ("STOP forward from 0.50 m/s",), ["failed"]),
        (at_standstill, ("Standstill",), ["failed"]),
        (at_the_first_question, ("STOP forward from 0.50 m/s",), ["failed"]),
        (
            at_the_second_question,
            ("STOP forward from 0.20 m/s", "STOP backward from 0.20 m/s"),
            ["passed", "failed"],
        ),
        (after_the_motion, ("STOP forward from 0.50 m/s",), ["failed"]),
    ],
)
def test_ctrl_c_is_an_emergency_stop_at_any_moment(
    moment: Callable[[Fixture], None],
    titles: tuple[str, ...],
    outcomes: list[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with driving(monkeypatch) as it:
        moment(it)
        with pytest.raises(KeyboardInterrupt):
            it.run(*titles)
        it.session.listen(0.5)
        assert it.speed == 0
        assert it.session.fresh_state().latched == ("estop",)
        assert it.outcomes == outcomes
        assert "safety has latched: estop" in it.finding
        assert it.drive.report.aborted.endswith("safety has latched: estop")
        assert "Reset it with `t2 drive`." in it.operator.text


def test_an_emergency_stop_that_is_not_latched_is_reported_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with driving(monkeypatch) as it:
        monkeypatch.setattr(it.session, "order_stop", lambda robot: None)
        at_the_first_question(it)
        with pytest.raises(KeyboardInterrupt):
            it.run("STOP forward from 0.50 m/s")
        assert "latched: nothing; the emergency stop is NOT CONFIRMED." in it.finding
        assert "Stop the vehicle with its own switch." in it.operator.text


@pytest.mark.parametrize(
    ("lost", "name"), [(("velocity", "mileage"), "counters"), (("velocity",), "velocity")]
)
def test_a_motion_without_measurements_is_braked(
    lost: tuple[str, ...], name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = iter(["", "go on"])
    with driving(monkeypatch, answers=lambda _: next(answers)) as it:
        real, begin = it.session.receive, it.inspector.stack.vehicle.truth

        def lose() -> None:
            it.session.receive = (  # type: ignore[method-assign]
                lambda sample: None if sample.key.endswith(lost) else real(sample)
            )

        it.when(0.05, lose)
        assert it.run("STOP forward from 0.80 m/s") == ["failed"]
        assert it.finding.startswith(f"Nothing is received of the {name} for 0.3 s while it mov")
        assert it.session.fresh_state().latched == ("estop",)
        end = it.inspector.stack.vehicle.truth
        assert math.dist((begin.x, begin.y), (end.x, end.y)) < 0.4


@pytest.mark.parametrize(
    ("space_m", "turned", "outcome", "text"),
    [
        (math.inf, 0.0, "passed", ""),
        (0.8, 0.0, "", "its way back needs "),
        (math.inf, math.radians(11), "", "turned by 11 degrees: the return is left out."),
        (math.inf, math.radians(9), "passed", ""),
    ],
)
def test_the_return_needs_space_and_the_first_heading(
    space_m: float, turned: float, outcome: str, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with driving(monkeypatch) as it:
        it.drive.space_m = space_m
        real, given = it.drive._counters, iter([0.0, turned])
        monkeypatch.setattr(
            GuidedDrive,
            "_counters",
            lambda _: replace(now := real(), heading=now.heading + next(given)),
        )
        assert it.run("STOP forward from 0.50 m/s", returns=True)[1:] == [outcome] * bool(outcome)
        assert text in it.operator.text
        assert bool(it.drive.report.left_out) is bool(text)


@pytest.mark.parametrize(
    ("counts", "is_recorded"),
    [((5, 5, 5), False), ((5, 9, 14), True), ((), False)],
)
def test_a_recorder_must_go_on_writing(
    counts: tuple[int, ...], is_recorded: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    with driving(monkeypatch) as it:
        it.drive.unrecorded, it.drive.recorders = False, frozenset({it.inspector.process.boot})
        one = m.Health(
            service="recorder", version="", uptime=1.0, rates={}, counters={}, lateness=0.0, rss=0,
            boot=it.inspector.process.boot,
        )  # fmt: skip
        for recorded_ in (1, 2):  # before
            it.session.of(keys.HEALTH).append(
                Latest(replace(one, counters={"recorded": recorded_}), 0)
            )
        left, begin_ns = list(counts), it.inspector.stack.net.now_ns

        def each_step() -> None:
            waited_ns = it.inspector.stack.net.now_ns - begin_ns
            if left and waited_ns > (len(counts) - len(left) + 0.5) * 0.9 * NS_PER_S:
                beat = replace(one, counters={"recorded": left.pop(0)})
                it.inspector.process.post(keys.HEALTH.on("001", service="recorder"), beat)

        it.inspector.each_step = each_step
        assert it.drive._is_recorded() is is_recorded


def test_skipped_and_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = iter([SKIPPED, "", "", "on with it"])
    with driving(monkeypatch, answers=lambda _: next(answers)) as it:
        it.inspector.stack.vehicle.inject(Bumper(pressed=True))
        it.inspector.stack.run(500)
        it.inspector.stack.vehicle.inject(Bumper(pressed=False))
        it.inspector.stack.run(500)
        assert it.run("STOP forward from 0.20 m/s", "STOP backward from 0.20 m/s") == [
            "skipped", "failed",
        ]  # fmt: skip
        assert it.finding == "The earlier latch of safety was not reset."
        assert it.drive.report.manoeuvres[0][1].text == SKIPPED


def chosen(*groups: Group) -> Callable[[Report, CheckoutSession], None]:
    return lambda report, session: guided_drive(report, session, groups, 1.0)


@pytest.mark.parametrize(
    ("answers", "error"),
    [
        (["hm"], "No recorder is running"),
        (["", "hm"], "No recorder is running"),
        (["without a recording", "wheels off the ground", "no"], "not confirmed"),
    ],
)
def test_it_refuses_to_begin(
    answers: list[str], error: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = iter(answers)
    with driving(monkeypatch, answers=lambda _: next(left)) as it:
        with pytest.raises(T2Error, match=error):
            chosen("straight")(it.drive.report, it.session)
        assert it.outcomes == []
        assert list(left) == []


def test_groups_and_the_free_space_choose(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = {"recording": "without a recording", "confirm": "on the ground, free space"}

    def answer(question: str) -> str:
        return next((text for word, text in answers.items() if word in question), "")

    with driving(monkeypatch, answers=answer) as it:
        chosen("straight", "return")(it.drive.report, it.session)
        made: list[Manoeuvre] = plan(it.drive.settings)  # type: ignore[assignment]
        near = [one.title for one in made if one.group == "straight" and one.ahead <= 1.0]
        assert [title for title, _ in it.drive.report.manoeuvres] == near
        assert it.drive.report.left_out == ["44 manoeuvres by --only or --space"]
        assert ("recording", "none: No recorder is running: start `t2 record` on the robot, in "
                "another terminal.") in it.drive.report.facts  # fmt: skip
