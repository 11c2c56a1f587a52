"""States of the pose in the map: placements, fixes that are used or refused, odometry anew."""

import math
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.pose import Covariance, Pose
from services.localization.core.estimate import Located
from services.localization.core.fixes import AGREEING
from services.localization.core.localizer import GAP_S, SILENT_NS, USED
from t2.messages import Fix, MapPose
from tests.localization.core.vehicle_fixture import SIGMA, STEP_NS, STEP_S, Drive, diagonal

PLACES = {"sigma": 0.02, "places": True}
TAGS = {"sigma": 0.02}
AWAY = 5.0  # m, of a wrong fix


def placed(**sources: Any) -> Drive:
    """Return a vehicle that is placed, with one source of fixes."""
    drive = Drive(Pose(3.0, -2.0, 1.0), **sources or {"tags": TAGS})
    drive.go()
    assert drive.place().state == "placed"
    return drive


def wrong(drive: Drive, away: float = AWAY) -> Fix:
    """Return a fix that is away from the truth."""
    return drive.measured(x=drive.true.x + away)


def test_nothing_is_known_before_odometry_and_a_placement() -> None:
    drive = Drive(tags=TAGS)
    assert drive.localizer.pose(0) is None
    refused = drive.localizer.place(Located(drive.true, Covariance.of(diagonal(1.0, 1.0))), 0)
    assert refused is not None
    assert refused.name == "place.no_odometry"
    pose = drive.go()
    assert (pose.state, pose.x, pose.odom) == ("unplaced", None, None)
    assert [phrase.name for phrase in pose.phrases] == ["map.unplaced"]
    assert "settings do not let these fixes place it" in drive.fix()
    assert "place the vehicle" in pose.text


def test_a_vehicle_is_placed_while_it_stands_and_odometry_arrives() -> None:
    drive = Drive()
    drive.go(linear=0.3, steps=5)
    known = Located(drive.true, Covariance.of(diagonal(0.1, 0.1)))
    refused = drive.localizer.place(known, drive.now_ns)
    assert refused is not None
    assert refused.name == "place.moving"
    drive.go(angular=0.3)
    refused = drive.localizer.place(known, drive.now_ns)
    assert refused is not None
    assert refused.name == "place.moving"
    drive.go()
    refused = drive.localizer.place(known, drive.now_ns + SILENT_NS + 1)
    assert refused is not None
    assert refused.name == "place.no_odometry"
    assert drive.localizer.place(known, drive.now_ns + SILENT_NS) is None
    assert drive.pose().placement == 1
    assert drive.place().placement == 2


@pytest.mark.no_cover
def test_odometry_alone_keeps_the_pose_and_grows_less_certain_until_it_is_lost() -> None:
    drive = placed()
    start = drive.pose().pose_covariance
    pose = drive.go(linear=0.5, angular=0.3, steps=500)
    assert drive.error() == pytest.approx((0.0, 0.0), abs=0.5)
    assert start
    assert pose.pose_covariance
    assert pose.pose_covariance[0] > start[0]
    while pose.state == "placed" and drive.seq < 10_000:
        pose = drive.go(linear=4.0, angular=2.4, steps=100)
    assert pose.state == "lost"
    assert "known only to" in pose.text
    assert pose.x is not None  # still the best that is known
    assert "5 fixes in a row agree" in drive.fix(wrong(drive, away=0.5)), "one is not enough"
    for _ in range(AGREEING):
        pose = drive.go(linear=0.5)
        assert pose.state == "lost"
        drive.fix()
    assert drive.go().state == "placed"
    assert drive.error()[0] < 0.3


def test_the_origin_of_odom_turns_odometry_into_the_map() -> None:
    drive = placed()
    pose = drive.go(linear=0.5, angular=0.2, steps=100)
    assert pose.odom
    assert drive.odometry
    assert pose.x is not None
    assert pose.heading is not None
    origin = Pose(pose.odom.x, pose.odom.y, pose.odom.heading)
    again = origin.then(Pose(drive.odometry.x, drive.odometry.y, drive.odometry.heading))
    assert (again.x, again.y, again.heading) == pytest.approx((pose.x, pose.y, pose.heading))
    assert (pose.odom_boot, pose.odom_seq) == (drive.boot, drive.seq)


@pytest.mark.no_cover
@pytest.mark.parametrize("delay", [0, 1, 20])
@pytest.mark.parametrize("heading", [True, False])
def test_late_fixes_keep_the_pose_honest(delay: int, heading: bool) -> None:
    errors, waiting = [], []
    for seed in range(4):
        drive = Drive(seed=seed, tags=TAGS)
        drive.go()
        drive.place(sigma=0.1, pose=drive.true.moved(0.05, 0.05))
        for step in range(1500):
            drive.go(linear=0.4, angular=0.4 * math.sin(step / 50))
            if step % 5 == 0:
                waiting.append((step + delay, drive.measured(turned=heading)))
            while waiting and waiting[0][0] <= step:
                drive.fix(waiting.pop(0)[1])
            if step > 100 and step % 25 == 0:
                errors.append(nees(drive))
        waiting.clear()
        (state,) = drive.pose().sources
        assert state.used > 270
        assert drive.pose().state == "placed"
    assert 2.0 < np.mean(errors) < 4.0
    assert np.mean(np.array(errors) < 7.8) > 0.92


def nees(drive: Drive) -> float:
    """Return the squared error in standard deviations."""
    pose = drive.pose()
    assert pose.x is not None
    assert pose.y is not None
    assert pose.heading is not None
    turned = math.remainder(pose.heading - drive.true.heading, math.tau)
    error = np.array([pose.x - drive.true.x, pose.y - drive.true.y, turned])
    matrix = np.array(pose.pose_covariance).reshape(3, 3)
    return float(error @ np.linalg.solve(matrix, error))


@pytest.mark.parametrize(("steps", "text"), [(50, ""), (51, "older than 2 s")])
def test_a_fix_is_used_for_2_s(steps: int, text: str) -> None:
    drive = placed()
    drive.go()
    late = drive.measured()
    drive.go(steps=steps)
    assert text in drive.fix(late)
    assert bool(text) is bool(drive.pose().sources[0].refused)


def test_a_fix_of_the_sample_of_a_placement_is_used_once() -> None:
    drive = placed()
    assert drive.fix() == ""
    drive.place()
    assert "no newer odometry message" in drive.fix()


def test_an_older_fix_is_used_before_the_newer_ones() -> None:
    one, other = placed(tags=TAGS, gnss=TAGS), placed(tags=TAGS, gnss=TAGS)
    for drive in (one, other):
        drive.go(linear=0.4, steps=10)
        early = drive.measured()
        drive.go(linear=0.4, steps=10)
        late = drive.measured()
        order = (("gnss", early), ("tags", late))
        for source, fix in order if drive is one else reversed(order):
            assert drive.fix(fix, source) == ""
    first, second = one.pose(), other.pose()
    assert (first.x, first.y) == pytest.approx((second.x, second.y))
    assert first.pose_covariance == pytest.approx(second.pose_covariance)


def test_single_outliers_are_refused_and_lose_nothing() -> None:
    drive = placed()
    for step in range(100):
        drive.go(linear=0.3)
        if step % 10 == 5:
            assert "standard deviations from the pose" in drive.fix(wrong(drive, away=step))
        else:
            drive.fix()
    (state,) = drive.pose().sources
    assert drive.pose().state == "placed"
    assert state.refused >= 10
    assert drive.error()[0] < 0.1


def test_an_outlier_says_how_far_it_is_from_the_pose() -> None:
    drive = placed()
    drive.place(sigma=0.1)
    drive.go()
    true = drive.true
    text = drive.fix(drive.measured(x=true.x + 2.0, y=true.y, heading=true.heading))
    sigmas = 2.0 / math.sqrt(0.1**2 + SIGMA**2 + TAGS["sigma"] ** 2)
    assert text == f"It is {sigmas:.1f} standard deviations from the pose."
    (state,) = drive.localizer.pose(drive.now_ns + NS_PER_S).sources  # type: ignore[union-attr]
    assert state.age == 1.0


def test_outliers_that_do_not_agree_lose_nothing() -> None:
    drive = placed()
    for step in range(30):
        drive.go(linear=0.3)
        drive.fix(wrong(drive, away=AWAY + 3 * (step % 2)))
    (state,) = drive.pose().sources
    assert (drive.pose().state, state.used, state.in_a_row) == ("placed", 0, 30)


@pytest.mark.parametrize("heading", [True, False])
def test_fixes_that_contradict_the_pose_and_agree_make_it_lost(heading: bool) -> None:
    drive = placed()
    for _ in range(AGREEING):
        assert drive.pose().state == "placed"
        drive.go(linear=0.3)
        drive.fix(drive.measured(turned=heading, x=drive.true.x + AWAY))
    pose = drive.pose()
    assert pose.state == "lost"
    assert "5 fixes of tags in a row contradict it" in pose.text
    assert drive.error()[0] < 0.1, "nothing jumps"
    drive.go(steps=5)
    drive.fix()
    assert drive.pose().state == "lost", "only a placement ends it"
    assert drive.place().state == "placed"


def test_agreement_is_by_the_way_that_odometry_shows() -> None:
    drive = placed()
    for step in range(20):
        drive.go(linear=0.5, angular=0.5, steps=5)
        drive.fix(drive.measured(x=drive.true.x + AWAY, heading=1.0 * step))  # the heading spins
    assert drive.pose().state == "placed"


def test_a_frozen_source_is_refused_once_the_vehicle_moves() -> None:
    drive = placed()
    frozen = drive.measured()
    texts = []
    for _ in range(40):
        drive.go(linear=0.5)
        again = drive.measured(x=frozen.x, y=frozen.y, heading=frozen.heading)
        texts.append(drive.fix(again))
    assert "repeats the last pose" in texts[-1]
    assert drive.pose().state == "placed"
    assert drive.error()[0] < 0.2


def test_fixes_that_cannot_be_used_are_refused_with_the_reason() -> None:
    drive = placed()
    drive.go(linear=0.3)
    old = drive.measured()
    assert drive.fix() == ""
    for fix, reason in (
        (drive.measured(odom_boot=99), "another start of odometry"),
        (drive.measured(odom_seq=drive.seq + 1), "older than 2 s"),
        (drive.measured(covariance=(1.0, 5.0, 0.0, 5.0, 1.0, 0.0, 0.0, 0.0, 1.0)), "definite"),
        (drive.measured(covariance=(-5.0, 0.0, 0.0, 0.0, -5.0, 0.0, 0.0, 0.0, -5.0)), "definite"),
        (drive.measured(covariance=(0.0,) * 9), "definite"),
        (drive.measured(covariance=(1.0, 0.5, 0.0, -0.5, 1.0, 0.0, 0.0, 0.0, 1.0)), "definite"),
        (drive.measured(), "no newer odometry message"),
    ):
        assert reason in drive.fix(fix)
    drive.go(steps=1)
    before = drive.measured()
    drive.go(steps=1)
    drive.place()
    assert "before the last placement" in drive.fix(before)
    drive.go(steps=60)
    assert "older than 2 s" in drive.fix(old)
    (state,) = drive.pose().sources
    assert (state.used, state.refused, state.in_a_row) == (1, 9, 9)


@pytest.mark.parametrize(
    "covariance",
    [diagonal(1e-6, 1e-6), (1e6, 1e6 - 1e-3, 0.0, 1e6 - 1e-3, 1e6, 0.0, 0.0, 0.0, 1e-6)],
)
def test_a_fix_counts_no_more_than_its_source_may(covariance: tuple[float, ...]) -> None:
    drive = placed(tags={"sigma": 0.5, "heading_sigma": 0.5})
    drive.go(linear=0.3)
    before = drive.pose().pose_covariance
    drive.fix(drive.measured(covariance=covariance))
    after = drive.pose().pose_covariance
    assert before
    assert after
    assert after[8] > 0.99 * before[8]
    assert before
    assert after
    assert after[0] > 0.99 * before[0]


def least_eigenvalue(pose: MapPose) -> float:
    """Return the least eigenvalue of a covariance."""
    return float(np.linalg.eigvalsh(np.array(pose.pose_covariance).reshape(3, 3))[0])


@pytest.mark.parametrize("linear", [0.0, 0.4])
@pytest.mark.parametrize("gap_s", [0.2, 1, 3, 20])
def test_counters_that_are_missing_for_a_while_leave_the_pose_honest(
    gap_s: float, linear: float
) -> None:
    drive, refused = placed(), 0
    for counts, seconds in ((True, 2.0), (False, gap_s), (True, 3.0)):
        drive.counts = counts
        for step in range(round(seconds * 25)):
            assert least_eigenvalue(drive.go(linear=linear)) > 0
            refused += bool(step % 3 == 0 and drive.fix())
            assert least_eigenvalue(drive.pose()) > 0
    assert (drive.pose().state, refused <= 1) == ("placed", True)
    assert drive.error() == pytest.approx((0.0, 0.0), abs=0.1)


def test_a_heading_that_is_too_uncertain_is_lost() -> None:
    drive = placed()
    assert drive.pose().text == (
        "The position is known to 0.01 m and 1 degrees (standard deviations)."
    )
    for sigma, heading, state in (
        (1.0, 0.5, "placed"), (1.01, 0.5, "lost"), (1.0, 0.51, "lost"), (0.1, 0.6, "lost"),
    ):  # fmt: skip
        known = Covariance.of(diagonal(sigma, heading))
        assert drive.localizer.place(Located(drive.true, known), drive.now_ns) is None
        assert drive.pose().state == state
    assert "known only to 0.10 m and 34 degrees" in drive.pose().text
    for _ in range(AGREEING - 1):
        drive.go(linear=0.3)
        assert "5 fixes in a row agree" in drive.fix()
    drive.go(linear=0.3)
    assert drive.fix() == ""
    assert drive.go().state == "placed"


def test_contradictions_do_not_survive_a_placement_or_a_fix_that_is_used() -> None:
    drive = placed()
    for end in (drive.place, drive.fix, drive.place):
        for _ in range(AGREEING - 1):
            drive.go(linear=0.3)
            drive.fix(wrong(drive))
        drive.go()
        end()
        assert drive.pose().state == "placed"


def test_a_source_that_another_one_outvotes_loses_nothing() -> None:
    drive = placed(tags=TAGS, gnss=TAGS)
    for _ in range(40):
        drive.go(linear=0.3)
        drive.fix(source="tags")
        drive.fix(wrong(drive), source="gnss")
    states = {each.source: each.in_a_row for each in drive.pose().sources}
    assert (drive.pose().state, states) == ("placed", {"tags": 0, "gnss": 40})
    assert drive.error()[0] < 0.1


def test_a_fix_of_the_place_before_a_placement_is_no_frozen_one() -> None:
    drive = placed()
    drive.go()
    fix = drive.measured()
    drive.fix(fix)
    drive.go(linear=0.5, steps=10)
    drive.go()
    drive.place()
    drive.go()
    again = drive.measured(x=fix.x, y=fix.y, heading=fix.heading)
    assert "repeats" not in drive.fix(again)


def test_a_source_that_places_needs_fixes_in_a_row_that_agree() -> None:
    drive = Drive(Pose(9.0, 9.0, 2.0), tags=PLACES)
    drive.go()
    assert "without a heading" in drive.fix(drive.measured(turned=False))
    for _ in range(AGREEING - 1):
        drive.go(linear=0.2)
        assert "5 fixes in a row agree" in drive.fix()
        assert drive.pose().state == "unplaced"
    drive.go(linear=0.2)
    assert drive.fix() == ""
    assert drive.pose().state == "placed"
    assert drive.error()[0] < 0.2


def test_a_pose_that_is_set_in_odometry_keeps_the_pose_in_the_map() -> None:
    drive = placed()
    drive.go(linear=0.4, angular=0.2, steps=50)
    before = drive.pose()
    drive.estimator.place(Pose(100.0, 50.0, 3.0), drive.now_ns)
    after = drive.go(linear=0.4, angular=0.2)
    assert (after.state, after.placement) == ("placed", before.placement)
    assert drive.error()[0] < 0.1
    assert drive.odometry
    assert drive.odometry.x > 90
    assert drive.go(linear=0.4, steps=50).state == "placed"
    assert drive.error()[0] < 0.1
    assert before.pose_covariance
    assert after.pose_covariance
    assert after.pose_covariance[0] > before.pose_covariance[0]


def test_the_motion_of_the_gap_in_which_a_pose_is_set_is_uncertain() -> None:
    drive = placed()
    before = drive.go(linear=0.4, angular=0.2, steps=50)
    drive.estimator.place(Pose(100.0, 50.0, 3.0), drive.now_ns)
    after = drive.go(linear=0.4, angular=0.2)
    distance, turn = 0.4 * STEP_S, 0.2 * STEP_S
    assert before.x is not None
    assert before.y is not None
    assert before.heading is not None
    pose = Pose(before.x, before.y, before.heading).moved(distance, turn)
    assert (after.x, after.y, after.heading) == pytest.approx((pose.x, pose.y, pose.heading))
    carried = np.eye(3)
    carried[:2, 2] = before.y - pose.y, pose.x - before.x
    covariance = carried @ np.array(before.pose_covariance).reshape(3, 3) @ carried.T
    covariance += np.diag([distance**2, distance**2, turn**2])
    assert after.pose_covariance == pytest.approx(covariance.ravel())


@pytest.mark.parametrize(
    ("gap_s", "state"),
    [(-0.001, "unplaced"), (0.0, "placed"), (GAP_S, "placed"), (GAP_S + 0.001, "unplaced")],
)
def test_after_which_gap_a_pose_that_is_set_keeps_its_place(gap_s: float, state: str) -> None:
    drive = placed()
    drive.estimator.place(Pose(100.0, 50.0, 3.0), drive.now_ns)
    drive.now_ns += round(gap_s * NS_PER_S) - STEP_NS
    assert drive.go().state == state


@pytest.mark.parametrize("steps", [20, 2000])
def test_a_pose_that_is_set_unseen_must_be_placed_again(steps: int) -> None:
    drive = placed()
    for _ in range(steps):
        drive.step(0.4, 0.0)  # localization receives nothing
    drive.estimator.place(Pose(0.0, 0.0, 0.0), drive.now_ns)
    pose = drive.go()
    assert (pose.state, pose.x) == ("unplaced", None)
    assert "began anew" in pose.text
    assert drive.place().state == "placed"


def test_a_restart_of_odometry_must_be_placed_again() -> None:
    drive = placed()
    drive.go(linear=0.3, steps=10)
    assert drive.fix() == ""
    drive.restart()
    drive.fix()
    drive.restart()
    pose = drive.go()
    assert pose.state == "unplaced"
    assert "began anew" in pose.text
    assert "not placed" in drive.fix(), "its numbers begin anew, too"


def test_odometry_that_is_repeated_or_reordered_changes_nothing() -> None:
    drive = placed()
    old = drive.odometry
    pose = drive.go(linear=0.4, steps=3)
    assert old is not None
    drive.localizer.on_odometry(old, drive.now_ns)
    assert drive.odometry is not None
    drive.localizer.on_odometry(replace(drive.odometry, x=99.0), drive.now_ns)
    assert drive.pose() == pose


def test_a_flood_of_fixes_keeps_the_newest_transforms_only() -> None:
    names = dict.fromkeys("abcdefgh", TAGS)
    drive = placed(**names)
    for _ in range(30):
        drive.go(linear=0.4)
        for name in names:
            drive.fix(source=name)
    assert len(drive.localizer._used) <= USED + len(names)
    assert drive.error()[0] < 0.1
