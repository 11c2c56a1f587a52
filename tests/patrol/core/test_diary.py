"""The record of a round: what was driven, visited and waited for, and the poses on the way."""

import pytest

from services.patrol.core.diary import FILES, MOST, NAME, Diary
from services.patrol.core.track import Fit, Nearest
from t2 import messages as m
from t2.messages import MAX_TRACK, Phrase

FIT = Fit(Nearest(0.0, 0.1, 0.0), 0.05, 0.5)


def diary() -> Diary:
    return Diary(m.Round(id="1", route="yard", robot="001", start_ns=0))


def driven(*places: float) -> Diary:
    """Return the diary of a drive over these places, x in m."""
    made = diary()
    for x in places:
        made.on_pose(x, 0.5, FIT)
    return made


def test_the_track_of_a_long_round_is_thinned() -> None:
    made = diary()
    for step in range(12_000):
        made.on_pose(step * 0.1, 0.0, FIT)
    assert MAX_TRACK / 2 < len(made.track) <= MAX_TRACK
    assert made.track[0].x == 0.0
    assert made.track[-1].x == pytest.approx(1200.0, abs=2.0)
    assert made.record.distance == pytest.approx(1199.9)


def test_a_correction_is_not_driven() -> None:
    made = driven(0.0, 0.5, 5.0, 5.125, 5.25)
    assert made.record.distance == 0.75  # a step of half a metre is driven
    assert [each.x for each in made.track] == [0.0, 0.5, 5.25]


def test_the_margin_is_the_least_of_the_round() -> None:
    made = diary()
    for deviation in (0.2, 0.3, 0.1):
        made.on_pose(0.0, 0.0, Fit(Nearest(0.0, deviation, 0.0), 0.05, 0.5))
    assert made.record.margin == pytest.approx(0.1)


def test_lists_of_a_round_that_never_ends_are_bounded() -> None:
    made = diary()
    for number in range(MOST + 50):
        made.visit("gate", number)
        made.halt("waiting", (), (0.0, 0.0), number)
        made.go_on(number - 10)  # the clock was set backward
        made.file("x.mcap")
    record = made.record
    assert (len(record.visits), len(record.halts)) == (MOST, MOST)
    assert len(record.recordings) == FILES
    assert {each.seconds for each in record.halts} == {0.0}


@pytest.mark.parametrize(
    ("places", "kept"),
    [
        ((1.0,), [1.0]),
        ((0.0, 0.125, 0.25, 0.375, 0.5), [0.0, 0.25, 0.5]),
        ((0.0, 0.2, 0.3), [0.0, 0.2]),
    ],
)
def test_a_pose_is_kept_each_twenty_centimetres(places: list[float], kept: list[float]) -> None:
    expected = [m.TrackPoint(x=x, y=0.5, deviation=0.1, sigma=0.05) for x in kept]
    assert driven(*places).track == expected


def test_a_full_track_keeps_every_second_pose_from_then_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("services.patrol.core.diary.MAX_TRACK", 4)
    made = driven(*(0.25 * step for step in range(13)))
    assert [each.x for each in made.track] == [0.0, 1.0, 2.0, 3.0]


def test_the_record_has_the_worst_of_all_poses() -> None:
    made = diary()
    for deviation, sigma in ((0.1, 0.05), (0.25, 0.0), (0.0, 0.125)):
        made.on_pose(0.0, 0.0, Fit(Nearest(0.0, deviation, 0.0), sigma, 0.5))
    record = made.record
    assert (record.deviation, record.sigma, record.margin) == (0.25, 0.125, 0.25)


def test_a_halt_ends_with_the_next_one() -> None:
    made, why = diary(), (Phrase("patrol.paused"),)
    second = 10**9
    made.halt("waiting", (Phrase("patrol.waiting"),), (1.0, 2.0), 5 * second)
    made.halt("paused", why, (3.0, 4.0), 7 * second)
    made.go_on(10 * second)
    made.go_on(11 * second)
    first, paused = made.record.halts
    assert (first.state, first.t_ns, first.seconds) == ("waiting", 5 * second, 2.0)
    text = "Paused: resume the round to go on."
    assert paused == m.Halt(
        state="paused", t_ns=7 * second, seconds=3.0, x=3.0, y=4.0, text=text, phrases=why
    )


def test_the_end_is_in_the_record_and_ends_a_halt() -> None:
    made, why = diary(), (Phrase("patrol.home"),)
    made.visit("gate", 1)
    made.visit("home", 2)
    made.file("a.mcap")
    made.file("b" * (NAME + 1))
    made.halt("waiting", (), (0.0, 0.0), 3)
    made.end("home", why, 4)
    assert made.record == m.Round(
        id="1",
        route="yard",
        robot="001",
        start_ns=0,
        end_ns=4,
        result="home",
        text="The round is complete, and the vehicle is at home.",
        phrases=why,
        visits=(m.Visit(station="gate", t_ns=1), m.Visit(station="home", t_ns=2)),
        halts=(m.Halt(state="waiting", t_ns=3, seconds=1e-9, x=0.0, y=0.0, text="", phrases=()),),
        recordings=("a.mcap", "b" * NAME),
    )
