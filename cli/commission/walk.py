"""The walk through the steps, and the sign-off at its end."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from cli.commission.operator import Operator
from cli.commission.report import Checked
from cli.commission.verdict import Verdict


@dataclass(frozen=True, slots=True)
class Stop:
    """One stop of the walk; ``what`` tells the operator in plain words what to do."""

    name: str
    title: str
    what: str
    check: Callable[[], Verdict]


def walk(stops: Sequence[Stop], operator: Operator, checked: list[Checked]) -> None:
    """Lead the operator through; ``checked`` grows, so that what was done outlives an abort."""
    for number, stop in enumerate(stops, 1):
        operator.say(f"\n[{number}/{len(stops)}] {stop.title}\n{stop.what}")
        verdict = _one(stop, operator)
        checked.append(Checked(stop.name, stop.title, verdict))


def sign(operator: Operator, name: str, checked: Sequence[Checked]) -> str:
    """Have the report signed by the one who did it; return the name, or an empty text."""
    operator.say("")
    for one in checked:
        operator.say(f"{one.verdict.outcome:8} {one.title}: {one.verdict.text}")
    typed = operator.ask(f"To sign this off, type your name ({name}):")
    return name if name and typed.casefold() == name.casefold() else ""


def _one(stop: Stop, operator: Operator) -> Verdict:
    reason = operator.ask("Enter begins; a reason skips it:")
    if reason:
        return Verdict("skipped", reason)
    while True:
        verdict = stop.check()
        operator.say(f"{verdict.outcome}: {verdict.text}")
        if verdict.outcome == "passed" or operator.ask("Enter tries again; any word goes on:"):
            return verdict
