"""The result of ``t2 checkout stop``: as text, as JSON, and whether it passed. Pure."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from cli.commission.stop_fit import (
    Estimate,
    Fit,
    Group,
    Settings,
    fits,
    label,
    missing,
    present_settings,
    propose,
    shortfall,
    too_long,
)
from cli.commission.stops import Stop
from cli.inspect import output
from services.safety.config import Safety

STOPS = ("stop", "command", "speed m/s", "reaction s", "deceleration m/s2", "distance m",
         "reckoned m", "recording")  # fmt: skip
FITS = ("command", "stops", "speeds m/s", "reaction s (95 %)", "next at most",
        "deceleration m/s2 (95 %)", "next at least")  # fmt: skip


@dataclass(frozen=True, slots=True)
class Measured:
    """Stops of all recordings; ``period_s`` is the longest time between two velocities."""

    stops: Sequence[Stop]
    left_out: Counter[str]
    period_s: float


@dataclass(frozen=True, slots=True)
class Result:
    """What the stops show about the vehicle and about safety's present settings."""

    measured: Measured
    present: Settings
    sensing_s: float
    fits: Mapping[Group, Fit]
    missing: Sequence[str]  # what must be recorded before settings can be proposed
    proposal: Settings | None
    problem: str  # why there is no proposal although nothing is missing
    too_long: Sequence[int]  # indices of stops
    shortfall: tuple[float, float]  # m/s, and m that the present settings lack there

    @property
    def verdict(self) -> str:
        """Verdict on the present settings."""
        if self.too_long or self.problem:
            return "not safe"
        if self.proposal is None:
            return "unknown"
        return "less cautious than proposed" if self.shortfall[1] > 0 else "safe"

    @property
    def passed(self) -> bool:
        """Whether the present settings are known to be safe."""
        return self.verdict == "safe"


def evaluate(measured: Measured, safety: Safety, sensing_s: float) -> Result:
    """Return the result; ``sensing_s`` is the age of a sonar's reading at the command."""
    present = present_settings(safety)
    found = fits(measured.stops, measured.period_s)
    lacking = tuple(missing(measured.stops, safety.max_linear))
    proposed = "" if lacking else propose(found, measured.stops, safety.margin, sensing_s)
    proposal = proposed if isinstance(proposed, Settings) else None
    return Result(
        measured=measured,
        present=present,
        sensing_s=sensing_s,
        fits=found,
        missing=lacking,
        proposal=proposal,
        problem=proposed if isinstance(proposed, str) else "",
        too_long=too_long(measured.stops, present),
        shortfall=shortfall(present, proposal, safety.max_linear) if proposal else (0.0, 0.0),
    )


def as_text(result: Result) -> str:
    """Return the result as text."""
    measured = result.measured
    left = ", ".join(f"{count} {reason}" for reason, count in measured.left_out.most_common())
    parts = [
        output.table(STOPS, [_stop_row(result, n) for n in range(len(measured.stops))]),
        f"Left out: {left}." if left else "",
        output.table(FITS, [_fit_row(*each) for each in result.fits.items()])
        if result.fits
        else "",
        f"Reaction times are resolved to {measured.period_s:.3f} s, the time between two "
        "velocities, and distances to 0.001 m. The bounds contain this.",
        "\n".join(_proposal(result)),
        "\n".join(_present(result)),
    ]
    return "\n\n".join(part for part in parts if part)


def as_json(result: Result) -> dict[str, Any]:
    """Return the result as JSON fields; SI units."""
    measured = result.measured
    return {
        "stops": [
            asdict(stop)
            | {"reckoned": result.present.reckoned(stop.speed), "long": n in result.too_long}
            for n, stop in enumerate(measured.stops)
        ],
        "left_out": dict(measured.left_out),
        "resolution": measured.period_s,
        "fits": [
            {"kind": group[0], "direction": group[1]} | asdict(fit)
            for group, fit in result.fits.items()
        ],
        "sensing": result.sensing_s,
        "missing": list(result.missing),
        "problem": result.problem,
        "proposal": asdict(result.proposal) if result.proposal else None,
        "present": asdict(result.present) | {"verdict": result.verdict},
    }


def _stop_row(result: Result, index: int) -> Sequence[str]:
    stop = result.measured.stops[index]
    return (
        str(index + 1),
        label((stop.kind, stop.direction)) + ", then BRAKE" * stop.braked,
        f"{stop.speed:.3f}",
        f"{stop.reaction:.3f}",
        f"{stop.deceleration:.2f}",
        f"{stop.distance:.3f}",
        f"{result.present.reckoned(stop.speed):.3f}",
        stop.file,
    )


def _fit_row(group: Group, fit: Fit) -> Sequence[str]:
    return (
        label(group),
        str(fit.stops),
        f"{fit.slowest:.2f} to {fit.fastest:.2f}",
        _interval(fit.reaction, 3),
        f"{fit.reaction.next_high:.3f}",
        _interval(fit.deceleration, 2),
        f"{fit.deceleration.next_low:.2f}",
    )


def _interval(one: Estimate, digits: int) -> str:
    return f"{one.mean:.{digits}f} ({one.low:.{digits}f} to {one.high:.{digits}f})"


def _proposal(result: Result) -> Iterator[str]:
    if result.missing:
        yield "No settings are proposed yet. Record on free, level ground:"
        yield from (f"- {each}" for each in result.missing)
    elif result.proposal is None:
        yield f"No settings are proposed: {result.problem}."
    else:
        one = result.proposal
        slowest = max(fit.reaction.next_high for fit in result.fits.values())
        yield "Proposed settings:"
        yield ""
        yield "[safety]"
        yield (
            f"react = {one.react:.2f}  # s: {slowest:.3f} from the command, "
            f"{result.sensing_s:.3f} from the reading to it"
        )
        yield f"deceleration = {one.deceleration:.2f}  # m/s^2"
        yield f"margin = {one.margin:.2f}  # m"


def _present(result: Result) -> Iterator[str]:
    now = result.present
    yield (
        f"Present settings: react {now.react:g} s, deceleration {now.deceleration:g} m/s2, "
        f"margin {now.margin:g} m."
    )
    for index in result.too_long:
        stop = result.measured.stops[index]
        yield (
            f"NOT safe: stop {index + 1} took {stop.distance:.2f} m, "
            f"reckoned {now.reckoned(stop.speed):.2f} m."
        )
    speed, room = result.shortfall
    if room > 0:
        yield f"Less cautious than proposed: {room:.3f} m less room at {speed:.2f} m/s."
    if result.problem:
        yield "NOT safe: no settings are."
    if result.verdict == "unknown":
        yield "Unknown whether they are safe: no stop was longer than reckoned, but stops are due."
    if result.passed:
        yield "They are safe: no stop was longer than reckoned, and they keep the proposed room."
