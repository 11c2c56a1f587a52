"""Proposals for vehicles that slow down less on RUN than on STOP."""

import pytest

from sim.model import Drive, Model
from verification.fit.run import measured


@pytest.mark.parametrize(("on_run", "proposal"), [(0.3, 0.3), (0.9, 0.6)])
def test_a_deceleration_is_one_that_run_has_shown(on_run: float, proposal: float) -> None:
    drive = Drive(coast=0.8, acceleration=on_run, brake=1.5)
    found = measured(("weak on RUN", Model(drive=drive), 1.0))
    assert found.missing == []
    deceleration = float(found.proposals["vehicle.deceleration"])
    assert deceleration == pytest.approx(proposal, abs=0.03)
    assert deceleration <= proposal
