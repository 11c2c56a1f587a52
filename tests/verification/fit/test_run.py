"""Proposals for vehicles that slow down less on RUN than on STOP."""

from sim.model import Drive, Model
from verification.fit.run import measured


def test_a_deceleration_is_one_that_run_has_shown() -> None:
    drive = Drive(coast=0.8, acceleration=0.3, brake=1.5)
    found = measured(("weak on RUN", Model(drive=drive), 1.0))
    assert found.missing == []
    assert 0.27 < float(found.proposals["vehicle.deceleration"]) <= 0.3
