"""The simulated localizer: what it measures, and when it sends it."""

import math
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest

from common.freshness import NS_PER_S
from sim.config import Sim
from sim.localizer import Localizer
from t2 import keys
from t2 import messages as m
from tests.factories import odometry
from tests.fake_bus import FakeBus

STEP_NS = 10_000_000


def fixes(seconds: float, **settings: Any) -> list[tuple[float, m.Fix]]:
    """Return the fixes of some seconds at a pose, with the time of each, s."""
    bus = FakeBus()
    true: Any = SimpleNamespace(x=1.0, y=2.0, heading=0.5)
    of = Sim(fix_source="tags", **settings)
    localizer = Localizer(bus, of, lambda _: true)
    begin_ns, found = localizer._next_ns, list[tuple[float, m.Fix]]()
    publisher: Any = next(each for each in bus.publishers if each.topic is keys.FIX)
    for step in range(round(seconds * NS_PER_S / STEP_NS)):
        now_ns = begin_ns + step * STEP_NS
        bus.deliver(keys.ODOMETRY, odometry(seq=step, boot=9), now_ns)
        before = publisher._seq
        localizer.step(now_ns)
        if publisher._seq > before:
            found.append((step * STEP_NS / NS_PER_S, publisher.last))
    return found


def test_fixes_are_true_up_to_their_noise_and_name_the_odometry_of_their_time() -> None:
    found = fixes(50.0, fix_rate=2.0, fix_sigma=0.05, fix_delay=0.3)
    assert len(found) == pytest.approx(100, abs=2)
    off = [each.x - 1.0 for _, each in found]
    assert math.sqrt(sum(each * each for each in off) / len(off)) == pytest.approx(0.05, rel=0.3)
    at_s, fix = found[4]
    assert fix.odom_boot == 9
    assert fix.odom_seq * STEP_NS / NS_PER_S == pytest.approx(at_s - 0.3)
    assert fix.covariance[0] == pytest.approx(0.05**2)


def test_some_fixes_are_wrong() -> None:
    found = fixes(100.0, fix_rate=5.0, fix_outliers=0.2)
    wrong = sum(math.dist((each.x, each.y), (1.0, 2.0)) > 0.5 for _, each in found)
    assert wrong / len(found) == pytest.approx(0.2, abs=0.06)


def test_there_are_gaps_without_any() -> None:
    found = [at_s for at_s, _ in fixes(120.0, fix_rate=2.0, fix_gap=20.0, fix_delay=0.0)]
    longest = max(after - before for before, after in pairwise(found))
    assert longest == pytest.approx(20.0, abs=1.0)
