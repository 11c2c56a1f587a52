"""Evaluation of made-up measurements."""

from typing import Any

import pytest

from common import motion
from sim.trace import Command
from verification.fleet.figures import (
    Request,
    answers_s,
    limits,
    markdown,
    name,
    on_the_wire,
    shares,
    uplinks,
)
from verification.fleet.page import scale, units
from verification.fleet.plot import save
from verification.fleet.resource_usage import parsed, since

RUN, STOP, BRAKE = motion.Command

MS = 1_000_000


def run(at_ms: int, linear: float, kind: motion.Command = RUN) -> Command:
    return Command(mono_ns=at_ms * MS, kind=kind, linear=linear, angular=0.0)


def request(at_ms: int, linear: float) -> Request:
    return Request(at_ms * MS, linear)


def test_an_answer_is_the_first_frame_of_the_speed_that_was_request() -> None:
    commands = [run(0, 0.3), run(5, 0.301), run(7, 0.301), run(60, 0.302)]
    found = answers_s([request(1, 0.301), request(50, 0.302)], commands)
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
def test_frames_that_are_no_answer(commands: list[Command]) -> None:
    assert answers_s([request(1, 0.301)], commands) == [None]


def made(**other: Any) -> Any:
    link = {"up": 1000.0, "down": 100.0, "up_segments": 10.0, "down_segments": 1.0}
    simulated = {"hz": 1200.0, "wanted_hz": 1200.0, "robots": 3, "late_s": 0.0, "stopped": 0}
    return {
        "robots": 5, "what": "everything", "shape": "peer", "thin": 0.0, "simulated": simulated,
        "subscriber": {"hz": 2000.0, "ages_s": [0.001, 0.002]}, "answers_s": [0.001, None],
        "site": {"cpu": 0.25, "rss": 40_000_000},
        "machine": {"busy": 0.5, "stolen": 0.0, "others": 0.1},
        "real_link": link, "simulated_link": link, "simulated_total": link,
        "parts": {"site": {"cpu": 0.25}, "router 0": {"cpu": 0.021}},
    } | other  # fmt: skip


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({}, ""),
        ({"machine": {"busy": 0.97, "stolen": 0.0, "others": 0.1}}, "machine"),
        ({"simulated": {"hz": 1100.0, "wanted_hz": 1200.0, "robots": 3}}, "generator"),
        ({"subscriber": {"hz": 1900.0, "ages_s": []}}, "arrival"),
        ({"subscriber": {"hz": 0.0, "ages_s": []}, "what": "nothing"}, ""),
        ({"subscriber": {"hz": 800.0, "ages_s": []}, "thin": 10.0}, ""),
        (
            {"simulated": None, "simulated_link": None, "subscriber": {"hz": 500.0, "ages_s": []}},
            "",
        ),
    ],
)
def test_saturation_is_named(other: dict[str, Any], said: str) -> None:
    window = made(**other)
    assert limits(window) == said
    assert markdown([window]).splitlines()[-1].endswith(f"| {said} |")


def test_table_rows() -> None:
    row = markdown([made(thin=10.0)]).splitlines()[-1]
    assert row.startswith("| 5 | everything, 10 Hz | 1200 | 2000 | 1.0 | 2.0 | 25 | 40 | 50 | 10 |")
    assert row.endswith("| 1.0 | 1.0 | 1 of 2 |  |")
    assert uplinks([made()]).splitlines()[-1] == "| 5 | everything | 12 | 1 | 2.1 | 12 | 1 | 0 |"
    assert "| - | - |" in uplinks([made(simulated_link=None)])
    assert shares([made(), made(what="nothing")]).splitlines()[2:] == [
        "| 5 | everything | 2 | 25 |"
    ]
    assert name(made(shape="router")) == "everything, routers"


def test_headers_are_included() -> None:
    assert on_the_wire(made()["real_link"], "up") == 1000 + 52 * 10


def test_a_plot_without_answers(tmp_path: Any) -> None:
    save(tmp_path / "a" / "fleet.png", [made(), made(answers_s=[None]), made(what="nothing")])
    assert (tmp_path / "a" / "fleet.png").read_bytes().startswith(b"\x89PNG")


SS = """\
ESTAB 0 0 127.0.0.1:5 127.0.0.1:7447 users:(("python",pid=7,fd=12)) cubic bytes_sent:100 \
bytes_acked:101 bytes_received:10 segs_out:3 segs_in:4 data_segs_out:2
ESTAB 0 0 127.0.0.1:6 127.0.0.1:7447 users:(("python",pid=7,fd=13)) bytes_sent:50 segs_out:1
TIME-WAIT 0 0 127.0.0.1:8 127.0.0.1:7447
"""


def test_connections_are_summed_by_process() -> None:
    assert parsed(SS) == {7: {"up": 150, "down": 10, "up_segments": 4, "down_segments": 4}}


def test_counts_become_rates() -> None:
    assert since({"up": 150}, {"up": 50}, 2.0) == {"up": 50.0}
    assert since({"up": 150}, {}, 2.0) == {"up": 75.0}


def fleet() -> list[Any]:
    """Return measurements of one robot and of eleven."""
    idle = {"hz": 0.0, "ages_s": []}
    return [
        made(robots=1, what="nothing", subscriber=idle, simulated=None, simulated_link=None,
             site={"cpu": 0.01, "rss": 40_000_000}),
        made(robots=11, what="nothing", subscriber=idle, site={"cpu": 0.11, "rss": 41_000_000}),
        made(robots=11, subscriber={"hz": 2200.0, "ages_s": []},
             site={"cpu": 0.22, "rss": 41_000_000}),
        made(robots=11, thin=10.0, subscriber={"hz": 4000.0, "ages_s": []},
             simulated={"hz": 3.0, "wanted_hz": 2000.0, "robots": 10}),
        made(robots=11, shape="router", what="nothing", subscriber=idle),
    ]  # fmt: skip


def test_cost_of_a_message_and_a_robot() -> None:
    assert units(fleet()) == (
        "A message that arrives and is forwarded once takes this much of a core: "
        "100 us with 11 robots. A robot takes 100 kB of the router's memory."
    )


def test_extrapolation() -> None:
    _, _, nothing, everything, thinned = scale(fleet()).splitlines()
    # 1,672 bytes a second with headers, both ways.
    assert nothing == "| nothing | 0 | 13 | 4.3 | 100 | 13 | 10.0 | 1,338 | 1,000.0 |"
    assert everything == "| everything | 200 | 13 | 4.3 | 50 | 13 | 20.0 | 1,338 | 2,000.0 |"
    assert thinned.startswith("| everything, 10 Hz | 380 |")
