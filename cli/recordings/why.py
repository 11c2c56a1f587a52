"""``t2 why``: why safety stopped, by its own decisions, made again from a recording.

Default: each stop with its cause, the input that shows it, its age and the rule. ``--at`` shows one
decision in full, ``--set`` what other settings would have decided.
"""

import argparse
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from cli.inspect import output
from cli.inspect.addressing import chunks
from cli.inspect.session import one_robot
from cli.recordings import decision_text as text
from cli.recordings.decision_replay import (
    SEVERITY,
    Decided,
    Replay,
    Variant,
    differences,
    new_stops,
)
from cli.recordings.info import open_recording
from cli.recordings.recorded_settings import NONE_RECORDED, Found, found_in, named, newest, restored
from cli.recordings.safety_inputs import UNSURE_NS, Recorded, Run, is_input, runs
from cli.settings import safety_config
from common.cli_args import add_sources, file_path, reader_language, sources
from common.config import Sources
from common.freshness import NS_PER_S
from common.motion import RUN, Twist
from common.text import printable
from services.safety.config import SafetyConfig
from services.safety.core.policy import Policy
from t2 import keys
from t2.errors import T2Error
from t2.messages import Motion
from t2.words import Language

CLOCK = re.compile(r"(\d\d):(\d\d):(\d\d(?:\.\d+)?)")  # UTC
DAY_S = 86_400
SHOWN_NS = NS_PER_S // 200  # half of the resolution of a time that is shown
INDENT = " " * 12


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("file", metavar="RECORDING", type=file_path)
    parser.add_argument(
        "--at", metavar="TIME", type=parse_time,
        help="the whole decision at this time: s since the start, as `t2 info` shows, or HH:MM:SS",
    )  # fmt: skip
    parser.add_argument("--robot", type=one_robot, help="which robot, such as 001")
    add_sources(parser)


def parse_time(word: str) -> float | str:
    """Parse seconds since the start, or a time of day (UTC)."""
    if CLOCK.fullmatch(word):
        return word
    try:
        return float(word)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{word!r} is not a time; use seconds since the start (12.3) or UTC (08:15:42)"
        ) from None


def run(options: argparse.Namespace) -> int:
    """Show the stops or one decision; return 1 if a motion did not come out again."""
    given = sources(options)
    chosen = from_sources(given) if options.config else None  # before the file is read
    recording = read(options.file, options.robot)
    used = [chosen or of_run(recording, run.boot, given) for run in recording.runs]
    view = View(recording, used, given.sets, reader_language())
    lines = list(view.at(options.at) if options.at is not None else view.stops())
    print(printable("\n".join(lines), "\n"), flush=True)
    return 0 if view.agrees else 1


# --- the file -----------------------------------------------------------------------------------


@dataclass(slots=True)
class Recording:
    """What a file contains of one robot."""

    file: Path
    robot: str = ""
    began_ns: int = 0
    ended_ns: int = 0
    is_cut: bool = False  # truncated or damaged
    runs: list[Run] = field(default_factory=list)
    settings: list[Found] = field(default_factory=list)  # of each run of safety

    def since_start(self, log_ns: int) -> float:
        """Return a time of the recording in seconds since its start."""
        return max(0, log_ns - self.began_ns) / NS_PER_S

    def moment(self, log_ns: int) -> str:
        """Return a time as `t2 info` shows it: seconds since the start, and UTC."""
        utc = datetime.fromtimestamp(log_ns / NS_PER_S, UTC)
        return f"{self.since_start(log_ns):8.2f} s  {utc:%H:%M:%S}"

    def log_ns(self, at: float | str) -> int:
        """Return the time that an option names; raise ``T2Error`` outside of the recording."""
        lasted_s = self.since_start(self.ended_ns)
        at_s = self._of_day(at) if isinstance(at, str) else at
        if not 0 <= at_s <= lasted_s:
            first, last = (self.moment(ns).strip() for ns in (self.began_ns, self.ended_ns))
            raise T2Error(f"--at {at}: the recording is from {first} to {last}")
        return self.began_ns + round(at_s * NS_PER_S)

    def _of_day(self, clock: str) -> float:
        hours, minutes, seconds = (float(part) for part in clock.split(":"))
        began_s = self.began_ns / NS_PER_S % DAY_S
        # A second's begin may be before the recording's start in it.
        at_s = hours * 3600 + minutes * 60 + seconds - began_s
        at_s = at_s + DAY_S if at_s <= -1 else at_s
        return max(0.0, at_s)


def read(file: Path, robot: str | None) -> Recording:
    """Read the messages of one robot; raise ``T2Error`` if they show no decisions."""
    found = Recording(file)
    robots: dict[str, list[Recorded]] = {}
    settings: list[Found] = []
    with open_recording(file) as reader:
        for entry in reader:
            found.began_ns = found.began_ns or entry.log_ns
            found.ended_ns = max(found.ended_ns, entry.log_ns)
            name, path = chunks(entry.key)
            if (shown := found_in(entry, file)) and shown.service == "safety":
                settings.append(shown)
            if not is_input(path, entry.kind):
                continue
            message = None if path == keys.ESTOP_PATH else entry.message
            if message is not None or path == keys.ESTOP_PATH:
                robots.setdefault(name, []).append(Recorded(path, message, entry.log_ns))
    found.is_cut = bool(reader.cut or reader.damaged)
    fleet = [each for name in robots if "*" in name for each in robots[name]]
    names = sorted(name for name in robots if "*" not in name)
    if robot is None and len(names) > 1:
        raise T2Error(f"{file}: recording of {', '.join(names)}: choose one with --robot")
    found.robot = robot or (names[0] if names else "")
    found.settings = [one for one in settings if one.robot == found.robot]
    recorded = sorted([*robots.get(found.robot, ()), *fleet], key=lambda one: one.log_ns)
    try:
        found.runs = runs(recorded)
    except T2Error as error:
        raise T2Error(f"{file}: robot {found.robot or '-'}: {error}") from None
    return found


# --- settings -----------------------------------------------------------------------------------

SECTIONS = ("host", "board", "vehicle", "safety")  # that safety decides by


class Used(Struct, frozen=True):
    """The settings of a replay."""

    config: SafetyConfig
    changed: SafetyConfig | None  # with the options ``--set``
    lines: Sequence[str]  # where they come from
    are_recorded: bool = False


def from_sources(given: Sources) -> Used:
    """Return the settings of files, environment and options; raise ``ConfigError``."""
    base = named(replace(given, sets=()), SECTIONS)
    changed = safety_config(named(given, SECTIONS).config) if given.sets else None
    return Used(safety_config(base.config), changed, [f"settings: {base.origin}"])


def of_run(recording: Recording, boot: int, given: Sources) -> Used:
    """Return the settings that this run of safety has recorded, otherwise those of another run.

    Without any, those of files and environment. Raise ``ConfigError``.
    """
    mine = [one for one in recording.settings if one.message.boot == boot]
    if not (found := newest(mine or recording.settings)):
        used = from_sources(given)
        return replace(used, lines=[f"{used.lines[0]}: {NONE_RECORDED}"])
    base = restored(found, SECTIONS)
    changed = safety_config(restored(found, SECTIONS, given.sets).config) if given.sets else None
    of = "" if mine else ", of another run: this one has none"
    lines = [f"settings: {base.origin}{of}", *(f"settings: {each}" for each in base.remarks)]
    return Used(safety_config(base.config), changed, lines, are_recorded=True)


# --- output -------------------------------------------------------------------------------------


@dataclass(slots=True)
class Agreement:
    """How many motions of a run came out again."""

    motions: int = 0
    compared: int = 0
    reordered: int = 0
    since_ns: int | None = None  # first compared one
    differing: int = 0
    first: Decided | None = None  # the first one that differs

    def add(self, decided: Decided) -> None:
        """Count a decision."""
        self.motions += 1
        if not decided.is_compared:
            return
        self.since_ns = decided.at_ns if self.since_ns is None else self.since_ns
        self.compared += 1
        self.reordered += decided.is_reordered
        if decided.differences:
            self.differing += 1
            self.first = self.first or decided


@dataclass(slots=True)
class Comparison:
    """How the motions of other settings differ from those of the recording's settings."""

    compared: int = 0
    differing: int = 0
    first: tuple[Decided, Motion] | None = None
    worst: tuple[Decided, Motion] | None = None

    def add(self, decided: Decided, other: Motion) -> None:
        """Count a decision with its motion of other settings."""
        self.compared += 1
        if not differences(decided.motion, other):
            return
        self.differing += 1
        self.first = self.first or (decided, other)
        if self.worst is None or _distance(decided, other) > _distance(*self.worst):
            self.worst = decided, other


def _distance(decided: Decided, other: Motion) -> tuple[int, float]:
    """Return how much two motions differ: first by the command, then by the speed."""
    one = decided.motion
    steps = abs(SEVERITY[one.command] - SEVERITY[other.command])
    return steps, abs(one.linear - other.linear) + abs(one.angular - other.angular)


@dataclass
class View:
    """The text of a recording's decisions."""

    recording: Recording
    used: Sequence[Used]  # of each run
    sets: Sequence[str]
    language: Language
    agrees: bool = True

    def stops(self) -> Iterator[str]:
        """Yield each stop of each run, and how many motions agree."""
        yield from self._head()
        for run, used in zip(self.recording.runs, self.used, strict=True):
            yield from used.lines
            lines: list[str] = []
            before: Decided | None = None
            agreement, comparison = Agreement(), Comparison()
            variant = Variant(used.changed) if used.changed else None
            for decided in Replay(used.config, run).decisions():
                agreement.add(decided)
                lines += self._stop(run, used.config, before, decided)
                if variant:
                    other = variant.decide(decided)
                    if decided.is_compared:
                        comparison.add(decided, other)
                before = decided
            yield from self._agreement(run, used, agreement)
            lines += self._last(run)
            yield from ["", "stops (since the start, and UTC):", *lines] if lines else ["no stop"]
            if variant:
                yield from ["", *self._comparison(run, comparison)]

    def at(self, at: float | str) -> Iterator[str]:
        """Yield the whole decision at a time."""
        log_ns = self.recording.log_ns(at)
        yield from self._head()
        runs = list(zip(self.recording.runs, self.used, strict=True))
        run, used = next(
            (pair for pair in reversed(runs)
             if pair[0].logged_ns(pair[0].motions[0].mono_ns) <= log_ns),
            runs[0],
        )  # fmt: skip
        yield from used.lines
        chosen = self._chosen(run, used, log_ns, NS_PER_S if isinstance(at, str) else 0)
        if chosen is not None:
            self.agrees = not chosen[0].differences
            yield from self._decision(run, used.config, *chosen)

    def _chosen(
        self, run: Run, used: Used, log_ns: int, span_ns: int
    ) -> tuple[Decided, Motion | None] | None:
        """Return the newest decision at a time, with the motion of the changed settings.

        A time of day is a whole second: the first stop in it, otherwise its first decision.
        """
        variant = Variant(used.changed) if used.changed else None
        chosen, before = None, None
        for decided in Replay(used.config, run).decisions():
            at_ns = run.logged_ns(decided.at_ns)
            if chosen is not None and at_ns > log_ns + max(span_ns, SHOWN_NS):
                break
            is_stop = bool(new_stops(before, decided)) and at_ns >= log_ns
            pair = decided, variant.decide(decided) if variant else None
            if is_stop and span_ns:
                return pair
            is_new = before is None or run.logged_ns(before.at_ns) < log_ns
            chosen, before = pair if is_new or not span_ns else chosen, decided
        return chosen

    def _head(self) -> Iterator[str]:
        recording = self.recording
        yield f"file: {recording.file}, robot {recording.robot}"
        if recording.is_cut:
            yield "The file is truncated or damaged: what is readable is used."
        if len(recording.runs) > 1:
            yield f"Safety started {len(recording.runs)} times: each run is shown by itself."

    def _stop(
        self, run: Run, settings: SafetyConfig, before: Decided | None, decided: Decided
    ) -> Iterator[str]:
        """Yield the lines of a stop that begins with this decision."""
        names = new_stops(before, decided)
        if not names or before is None:
            return
        worst, when = names[0], self.recording.moment(run.logged_ns(decided.at_ns))
        command = decided.motion.command.upper()
        yield f"{when}  {command:5}  {worst}: {text.cause_text(decided, worst, self.language)}"
        yield f"{INDENT}before: {text.motion_text(before.recorded)}"
        for each in text.shown_by(decided, worst, settings):
            yield f"{INDENT}input: {each}"
        yield f"{INDENT}rule: {text.rule(worst)}"
        if worst == "blocked":
            planner = Policy(settings).planner
            yield f"{INDENT}zone: {text.zone(decided, planner, settings)}"
        for name in names[1:]:
            yield f"{INDENT}also: {name}: {text.cause_text(decided, name, self.language)}"
        if not decided.is_compared:
            yield f"{INDENT}not verified: the replay takes its state from the recording here"
        elif decided.differences:
            yield f"{INDENT}DIFFERS: recorded was {text.motion_text(decided.recorded)}"

    def _last(self, run: Run) -> Iterator[str]:
        """Yield that safety's motions end while the vehicle drives, where they do."""
        last = run.motions[-1]
        if last.command is RUN and not Twist(last.linear, last.angular).rounds_to_zero:
            when = self.recording.moment(run.logged_ns(last.mono_ns))
            yield f"{when}  the motions of safety end here, or the recording"
            yield f"{INDENT}before: {text.motion_text(last)}"
            yield f"{INDENT}rule: without further motions the bridge stops the vehicle"

    def _agreement(self, run: Run, used: Used, found: Agreement) -> Iterator[str]:
        self.agrees = self.agrees and found.compared > 0 and not found.differing
        if found.since_ns is None:
            doubt = "" if used.are_recorded else "; were these the settings of the robot?"
            yield (
                f"replay: none of {found.motions} motions could be compared: the replayed state "
                f"never agreed for 0.5 s{doubt}"
            )
            return
        since = self.recording.moment(run.logged_ns(found.since_ns)).strip()
        yield (
            f"replay: {found.compared - found.differing} of {found.compared} motions agree, from "
            f"{since} on; {found.motions - found.compared} others only give the state to start from"
        )
        if found.reordered:
            yield (
                f"{found.reordered} of them agree with messages in another order: the order within "
                f"{UNSURE_NS / 1e6:.0f} ms is not recorded"
            )
        if found.first is not None:
            one = found.first
            yield (
                f"first difference at {self.recording.moment(run.logged_ns(one.at_ns)).strip()}: "
                f"{text.difference_text(one)}. A recording contains no message that the recorder "
                f"lost, and not the order of messages within {UNSURE_NS / 1e6:.0f} ms"
                + ("" if used.are_recorded else "; these may not be the settings of the robot")
            )

    def _comparison(self, run: Run, found: Comparison) -> Iterator[str]:
        yield (
            f"with {', '.join(self.sets)}: {found.differing} of {found.compared} motions differ. "
            "The reaction of the vehicle is not simulated: each decision begins at the recorded "
            "state."
        )
        for title, pair in (("first", found.first), ("worst", found.worst)):
            if pair is not None:
                decided, other = pair
                when = self.recording.moment(run.logged_ns(decided.at_ns))
                yield (
                    f"{when}  {title}: {text.motion_text(decided.motion)} becomes "
                    f"{text.motion_text(other)}"
                )

    def _decision(
        self, run: Run, settings: SafetyConfig, decided: Decided, other: Motion | None
    ) -> Iterator[str]:
        """Yield everything about one decision."""
        state = decided.state
        yield f"decision at {self.recording.moment(run.logged_ns(decided.at_ns)).strip()}"
        rows = [
            (each.name, _seconds(each.age_s), _seconds(each.limit_s),
             "TOO OLD" if each.is_late else "", each.value)
            for each in text.inputs(decided, settings)
        ]  # fmt: skip
        yield from ["", output.table(("input", "age s", "limit s", "", "value"), rows)]
        causes = text.held(decided, self.language)
        head = ("cause", "action", "since s", "good", "text")
        yield from ["", output.table(head, causes) if causes else "no cause is held"]
        yield ""
        planner = Policy(settings).planner
        requested = planner.requested(state, decided.at_ns)
        if requested is None:
            yield "request: none"
        else:
            slower = f", slowed by limit {requested.limited_by}" if requested.limited_by else ""
            yield f"request: {requested.source}: {text.speed(requested.twist)}{slower}"
        if plan := text.zone(decided, planner, settings):
            yield f"plan: {plan}"
        yield f"motion: {text.motion_text(decided.motion)}, verdict {state.verdict.name}"
        yield f"recorded: {text.motion_text(decided.recorded)}{_remark(decided)}"
        if other is not None:
            yield f"with {', '.join(self.sets)}: {text.motion_text(other)}"


def _remark(decided: Decided) -> str:
    if not decided.is_compared:
        return " (not compared: the replay takes its state from the recording here)"
    if decided.differences:
        return f" (DIFFERS in {', '.join(decided.differences)})"
    return " (agrees, with messages in another order)" if decided.is_reordered else " (agrees)"


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"
