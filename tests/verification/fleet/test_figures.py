"""What comes of a measurement, on measurements that are made up."""

from typing import Any

import pytest

from common import motion
from sim.trace import Command
from verification.fleet.figures import (
    Asked,
    answers_s,
    limits,
    markdown,
    name,
    on_the_wire,
    shares,
    uplinks,
)
from verification.fleet.gauges import parsed, since
from verification.fleet.page import scale, units
from verification.fleet.plot import save

RUN, STOP, BRAKE = motion.Command

MS = 1_000_000


def run(at_ms: int, linear: float, kind: motion.Command = RUN) -> Command:
    return Command(mono_ns=at_ms * MS, kind=kind, linear=linear, angular=0.0)


def asked(at_ms: int, linear: float) -> Asked:
    return Asked(at_ms * MS, linear)


def test_an_answer_is_the_first_frame_of_the_speed_that_was_asked() -> None:
    commands = [run(0, 0.3), run(5, 0.301), run(7, 0.301), run(60, 0.302)]
    found = answers_s([asked(1, 0.301), asked(50, 0.302)], commands)
    assert found == pytest.approx([0.004, 0.010])


@pytest.mark.parametrize(
    "commands",
    [
        [],
        [run(0, 0.301)],
        [run(5, 0.302)],
        [run(5, 0.301, STOP)],
        [run(1002, 0.301)],
    ],
)
def test_what_answers_nothing(commands: list[Command]) -> None:
    assert answers_s([asked(1, 0.301)], commands) == [None]


def made(**other: Any) -> Any:
    link = {"up": 1000.0, "down": 100.0, "up_segments": 10.0, "down_segments": 1.0}
    light = {"hz": 1200.0, "wanted_hz": 1200.0, "robots": 3, "late_s": 0.0, "stopped": 0}
    return {
        "robots": 5, "what": "everything", "shape": "peer", "thin": 0.0, "light": light,
        "ear": {"hz": 2000.0, "ages_s": [0.001, 0.002]}, "answers_s": [0.001, None],
        "site": {"cpu": 0.25, "rss": 40_000_000},
        "machine": {"busy": 0.5, "stolen": 0.0, "others": 0.1},
        "real_link": link, "light_link": link, "light_total": link,
        "parts": {"site": {"cpu": 0.25}, "router 0": {"cpu": 0.021}},
    } | other  # fmt: skip


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({}, ""),
        ({"machine": {"busy": 0.97, "stolen": 0.0, "others": 0.1}}, "machine"),
        ({"light": {"hz": 1100.0, "wanted_hz": 1200.0, "robots": 3}}, "generator"),
        ({"ear": {"hz": 1900.0, "ages_s": []}}, "arrival"),
        ({"ear": {"hz": 0.0, "ages_s": []}, "what": "nobody"}, ""),
        ({"ear": {"hz": 800.0, "ages_s": []}, "thin": 10.0}, ""),
        ({"light": None, "light_link": None, "ear": {"hz": 500.0, "ages_s": []}}, ""),
    ],
)
def test_what_was_saturated_is_said(other: dict[str, Any], said: str) -> None:
    window = made(**other)
    assert limits(window) == said
    assert markdown([window]).splitlines()[-1].endswith(f"| {said} |")


def test_a_row_holds_what_was_measured() -> None:
    row = markdown([made(thin=10.0)]).splitlines()[-1]
    assert row.startswith("| 5 | everything, 10 Hz | 1200 | 2000 | 1.0 | 2.0 | 25 | 40 | 50 | 10 |")
    assert row.endswith("| 1.0 | 1.0 | 1 of 2 |  |")
    assert uplinks([made()]).splitlines()[-1] == "| 5 | everything | 12 | 1 | 2.1 | 12 | 1 | 0 |"
    assert "| - | - |" in uplinks([made(light_link=None)])
    assert shares([made(), made(what="nobody")]).splitlines()[2:] == ["| 5 | everything | 2 | 25 |"]
    assert name(made(shape="router")) == "everything, routers"


def test_headers_count() -> None:
    assert on_the_wire(made()["real_link"], "up") == 1000 + 52 * 10


def test_a_picture_is_drawn_also_of_what_was_never_answered(tmp_path: Any) -> None:
    save(tmp_path / "a" / "fleet.png", [made(), made(answers_s=[None]), made(what="nobody")])
    assert (tmp_path / "a" / "fleet.png").read_bytes().startswith(b"\x89PNG")


SS = """\
ESTAB 0 0 127.0.0.1:5 127.0.0.1:7447 users:(("python",pid=7,fd=12)) cubic bytes_sent:100 \
bytes_acked:101 bytes_received:10 segs_out:3 segs_in:4 data_segs_out:2
ESTAB 0 0 127.0.0.1:6 127.0.0.1:7447 users:(("python",pid=7,fd=13)) bytes_sent:50 segs_out:1
TIME-WAIT 0 0 127.0.0.1:8 127.0.0.1:7447
"""


def test_connections_are_added_up_by_process() -> None:
    assert parsed(SS) == {7: {"up": 150, "down": 10, "up_segments": 4, "down_segments": 4}}


def test_counts_become_rates() -> None:
    assert since({"up": 150}, {"up": 50}, 2.0) == {"up": 50.0}
    assert since({"up": 150}, {}, 2.0) == {"up": 75.0}


def fleet() -> list[Any]:
    """Return measurements of one robot and of eleven."""
    idle = {"hz": 0.0, "ages_s": []}
    return [
        made(robots=1, what="nobody", ear=idle, light=None, light_link=None,
             site={"cpu": 0.01, "rss": 40_000_000}),
        made(robots=11, what="nobody", ear=idle, site={"cpu": 0.11, "rss": 41_000_000}),
        made(robots=11, ear={"hz": 2200.0, "ages_s": []}, site={"cpu": 0.22, "rss": 41_000_000}),
        made(robots=11, thin=10.0, ear={"hz": 4000.0, "ages_s": []},
             light={"hz": 3.0, "wanted_hz": 2000.0, "robots": 10}),
        made(robots=11, shape="router", what="nobody", ear=idle),
    ]  # fmt: skip


def test_what_a_robot_and_a_message_cost() -> None:
    assert units(fleet()) == (
        "A message that comes in and goes out once takes this much of a core: "
        "100 us with 11 robots. A robot takes 100 kB of the router's memory."
    )


def test_it_is_carried_on_to_more() -> None:
    _, _, nobody, everything, thinned = scale(fleet()).splitlines()
    # 1,672 bytes a second with headers, both ways.
    assert nobody == "| nobody | 0 | 13 | 4.3 | 100 | 13 | 10.0 | 1,338 | 1,000.0 |"
    assert everything == "| everything | 200 | 13 | 4.3 | 50 | 13 | 20.0 | 1,338 | 2,000.0 |"
    assert thinned.startswith("| everything, 10 Hz | 380 |")
