"""The runs with proposed settings: they end well, and they would show a proposal that is wrong."""

from typing import Any

import pytest
from msgspec.structs import replace

from cli.fit.estimate import Estimate
from cli.fit.fit import Fit
from cli.settings import Everything
from sim.config import load_model
from sim.model import Model, Sonar
from verification.fit import run
from verification.fit.__main__ import print_totals
from verification.fit.run import Result
from verification.fit.trial import Runs, Trial, approaches
from verification.search.stack import Stack

pytestmark = pytest.mark.simulated

TOO_BOLD = {
    "safety.react": 0.1,
    "safety.margin": 0.05,
    "vehicle.deceleration": 1.0,
    "vehicle.angular_deceleration": 3.0,
}
END = "sonars, greatest reading"
GOOD = Runs(failed="", contacts=(), nearest=0.19)
HIT = Runs(failed="", contacts=("forward at 1 m/s",), nearest=0.0)


def result(**changes: Any) -> Result:
    given: dict[str, Any] = {"today": GOOD, "proposed": GOOD, **changes}
    return Result(
        name="7", proposes=True, missing=(), unsafe=(), inside=1, outside=(), refused="", **given
    )


def gaps(name: str, model: Model, settings: dict[str, float]) -> list[float]:
    """Return the gaps that the approaches with this name leave."""
    trial = Trial(model, 1.0, settings)
    return [trial.approach(it) for it in approaches(model.vehicle) if it.name == name]


def test_an_ideal_vehicle_completes_the_lap() -> None:
    assert Trial(Model(), 1.0, {}).lap() == ""


def test_a_vehicle_that_may_not_drive_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("verification.fit.trial.LAP_MS", 3000)
    failed = Trial(load_model(["unconfirmed-switches"]), 1.0, {}).lap()
    assert failed == "goal 1 not reached, 2.00 m are left: switches, unarmed"


def test_what_must_be_set_first_is_set_before_the_vehicle_is_measured(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    end: dict[str, Any] = {"vehicle.sonar_max": 3.0}
    driven: list[dict[str, Any]] = []

    def fitted(_: Any, settings: dict[str, Any]) -> Fit:
        found, reading = Fit([], Everything()), 2.99 if settings else 3.0
        found.estimates = [
            Estimate(name=END, unit="m", values=(reading, reading), setting="vehicle.sonar_max")
        ]
        found.missing = [] if settings else ["5 more of STOP forward from 0.40 m/s or more"]
        found.proposals = dict(TOO_BOLD) if settings else dict(end)
        return found

    class FakeTrial(Trial):
        def __init__(self, _: Model, __: float, settings: dict[str, Any]) -> None:
            driven.append(settings)

        def run(self) -> Runs:
            return GOOD

    monkeypatch.setattr(run, "fitted", fitted)
    monkeypatch.setattr(run, "Trial", FakeTrial)
    ends = replace(Model(), sonar=Sonar(saturation=3.0))
    result = run.measure(("7", ends, 1.0))
    assert (result.proposed, result.inside) == (GOOD, 1)
    assert driven == [{}, {**end, **TOO_BOLD}]


def test_a_proposal_that_safety_refuses_is_not_driven(monkeypatch: pytest.MonkeyPatch) -> None:
    found = Fit([], Everything())
    found.proposals = {**TOO_BOLD, "vehicle.sonar_max": 0.5}
    monkeypatch.setattr(run, "fitted", lambda *_: found)
    refused = run.measure(("7", Model(), 1.0))
    assert refused.proposed is None
    assert refused.wrong == [refused.refused]
    assert "sonar_max 0.5 m is too near" in refused.refused


@pytest.mark.parametrize("name", ["forward at 1 m/s", "backward at 1 m/s"])
def test_settings_that_reckon_with_too_little_end_in_contact(name: str) -> None:
    slow = load_model(["slow-motors"])
    assert gaps(name, slow, TOO_BOLD) == [0.0]
    (gap,) = gaps(name, slow, {})
    assert 0.1 < gap < 0.3


def test_the_services_have_the_given_settings() -> None:
    stack = Stack(settings={"wire.command_angular_unit": "milliradian", **TOO_BOLD})
    safety, bridge = (stack.processes[name].config for name in ("safety", "bridge"))
    assert (safety.safety.react, safety.safety.margin) == (0.1, 0.05)
    assert safety.vehicle.deceleration == bridge.vehicle.deceleration == 1.0
    assert safety.vehicle.angular_deceleration == bridge.vehicle.angular_deceleration == 3.0
    assert bridge.wire.command_angular_unit == "milliradian"


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({}, []),
        ({"today": None, "proposed": None}, []),
        (
            {"proposed": HIT},
            ["contact: forward at 1 m/s (today: none)", "0.00 m to a wall (today: 0.19 m)"],
        ),
        (
            {"proposed": Runs(failed="goal 1 missed by 2.00 m", contacts=(), nearest=0.19)},
            ["lap: goal 1 missed by 2.00 m (today: completed)"],
        ),
    ],
)
def test_what_failed_is_said_beside_todays_runs(changes: dict[str, Any], text: list[str]) -> None:
    assert result(**changes).wrong == text


def test_the_totals_of_both_settings(capsys: pytest.CaptureFixture[str]) -> None:
    print_totals([result(), result(proposed=HIT), result(today=HIT, proposed=HIT)])
    first, both, today, proposed = capsys.readouterr().out.splitlines()
    assert first.startswith("3 vehicles; 3 with a proposal")
    assert both == "3 driven with both settings; 1 have contacts that today's do not have"
    assert "3 laps completed, 1 vehicles with contacts" in today
    assert "3 laps completed, 2 vehicles with contacts" in proposed
