"""How often the stated bounds hold, for stops of the simulated vehicle with known values."""

import pytest

from cli.commission.stop_fit import fits
from cli.commission.stops import Streams, find_stops
from tests.cli.commission.stops_fixture import SPEEDS, StopMaker

SEEDS = 200
COAST, SCATTER, JITTER_S = 0.7, 0.04, 0.04


@pytest.mark.campaign
def test_the_bounds_hold_as_often_as_stated() -> None:
    """And they are not just wide."""
    maker = StopMaker(1, delay=0.1, jitter=JITTER_S, coast=COAST, scatter=SCATTER)
    recovered = expected = 0
    for _ in range(SEEDS):
        maker.streams = Streams()
        for speed in (*SPEEDS, 0.6):
            maker.stop(speed)
        (*seen, following), _ = find_stops(maker.streams)
        fit = fits(seen, maker.streams.period_s)["stop", "forward"]
        reaction, deceleration = fit.reaction, fit.deceleration
        recovered += (
            reaction.low <= maker.reaction <= reaction.high
            and deceleration.low <= COAST <= deceleration.high
        )
        expected += (
            following.reaction <= reaction.next_high
            and following.deceleration >= deceleration.next_low
        )
        assert reaction.next_high < maker.reaction + 0.02 + 3 * JITTER_S
        assert deceleration.next_low > COAST / (1 + 8 * SCATTER)
    assert recovered >= 0.95 * SEEDS
    assert expected >= 0.95 * SEEDS
