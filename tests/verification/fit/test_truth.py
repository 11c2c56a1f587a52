"""The proof of ``t2 fit`` on two vehicles, and that it would find a wrong estimate."""

import pytest
from msgspec.structs import replace

from cli.fit.fit import DECELERATION, REACT, Fit
from cli.settings import Everything
from common.motion import Twist
from sim.config import load_model
from sim.model import Cable, Line, Model
from verification.fit.run import Vehicle, measure, measured, vehicles
from verification.fit.truth import late_s, stopped_within, truths, unsafe

pytestmark = pytest.mark.simulated

PROPOSED = {REACT: 0.11, DECELERATION: 0.79, "vehicle.angular_deceleration": 1.9}


def fitted(**changes: float) -> Fit:
    found = Fit([], Everything())
    found.proposals = {**PROPOSED, **changes}
    return found


def test_a_vehicle_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """A random one, with dead time and noise, that slows down less on RUN than on STOP."""
    fits: list[Fit] = []

    def fitted(vehicle: Vehicle) -> Fit:
        fits.append(measured(vehicle))
        return fits[-1]

    monkeypatch.setattr("verification.fit.run.measured", fitted)
    monkeypatch.setattr("verification.fit.trial.SHARES", (1.0,))
    name, model, turn_braking = vehicles(5)[-1]
    weak = replace(model, drive=replace(model.drive, coast=0.8, acceleration=0.3))
    result = measure((name, weak, turn_braking))
    assert 0.27 < float(fits[0].proposals[DECELERATION]) <= 0.3
    assert result.missing == ()
    assert result.proposes
    assert result.unsafe == ()
    assert len(result.outside) <= 1
    assert result.inside >= 1
    assert result.today is not None
    assert result.proposed is not None
    assert result.wrong == []


@pytest.mark.parametrize(
    ("changes", "short"),
    [
        ({}, False),
        ({REACT: 0.07}, True),
        ({DECELERATION: 0.85}, True),
        ({"vehicle.angular_deceleration": 2.2}, True),
    ],
)
def test_a_proposal_that_reckons_with_too_little_is_found(
    changes: dict[str, float], short: bool
) -> None:
    assert bool(unsafe(fitted(**changes), Model())) is short


def test_the_distance_of_a_stop_by_the_motors() -> None:
    model = load_model(["slow-motors"])
    ideal = replace(model, drive=replace(model.drive, lag=0.0, dead_time=0.0))
    a = model.drive.coast
    assert stopped_within(Twist(0.8), ideal, 0.5) == pytest.approx(0.8**2 / 2 / a, abs=0.01)
    late = replace(model, drive=replace(model.drive, lag=0.0))
    assert stopped_within(Twist(0.8), late, 0.5) == pytest.approx(
        0.8**2 / 2 / a + 0.8 * model.drive.dead_time, abs=0.01
    )
    assert stopped_within(Twist(0.8), model, 0.5) > stopped_within(Twist(0.8), late, 0.5)


def test_motors_with_lag_have_no_true_deceleration() -> None:
    assert "STOP left: deceleration" in dict(truths(Model()))
    assert "STOP left: deceleration" not in dict(truths(load_model(["slow-motors"])))


def test_a_late_datagram_arrives_at_the_end_of_a_step() -> None:
    assert max(late_s(Model())) == 0
    late = replace(Model(), cable=Cable(to_pc=Line(jitter=0.008), to_board=Line(delay=0.012)))
    assert late_s(late) == pytest.approx([0.03] * 100)
    assert dict(truths(late))["STOP left: reaction"] == pytest.approx(0.03)
    assert max(late_s(load_model(["late-port"]))) == 0  # of one port
