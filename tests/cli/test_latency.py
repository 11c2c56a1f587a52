"""``t2 latency`` without a stack: figures, table, silence, and a closed pipe."""

import io
import json
import subprocess
import sys
from typing import Any

import pytest
from rich.console import Console

from cli import latency
from cli.__main__ import main
from cli.latency import SILENCE, Watch, figures, print_line, table
from common import clock, keys
from common.bus.bus import Arrival
from common.cli_args import EXIT_LINK
from common.freshness import NS_PER_S
from common.loop import Loop
from common.messages import Durations, Health, Timing
from tests.cli.processes import PATIENCE_S, sets, t2
from verification.harness.bus import bus_on, router_process, running
from verification.harness.ports import free_port

TIMING = Timing(
    bounds=(0.001, 0.01),
    durations={
        "contact_to_break": Durations(counts=(0, 1, 0), worst=0.0042),
        "contact_to_break.bridge_to_break": Durations(counts=(98, 1, 1), worst=0.25),
        "request_to_frame": Durations(counts=(0, 0, 0), worst=0.0),
        "a_way.of_a_newer_bridge": Durations(counts=(1, 0, 0), worst=0.0005),
    },
    not_counted={"foreign_clock": 3, "implausible": 1},
)


def health(timing: Timing | None = TIMING) -> Health:
    return Health(
        service="bridge", version="1", uptime=61.4, rates={}, counters={}, lateness=0.0, rss=0,
        t_ns=7, boot=8, timing=timing,
    )  # fmt: skip


def drawn(newest: Health | None, silent: bool = False) -> str:
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(table(newest, silent))
    return console.export_text()


def test_figures_in_seconds() -> None:
    shown_figures = figures(health())
    assert (shown_figures["t_ns"], shown_figures["boot"], shown_figures["uptime"]) == (7, 8, 61.4)
    assert shown_figures["not_counted"] == {"foreign_clock": 3, "implausible": 1}
    durations = shown_figures["durations"]
    assert list(durations) == list(TIMING.durations)
    assert durations["contact_to_break"] == {
        "count": 1, "p50": 0.0042, "p99": 0.0042, "worst": 0.0042,
    }  # fmt: skip
    assert durations["contact_to_break.bridge_to_break"] == {
        "count": 100, "p50": 0.001, "p99": 0.01, "worst": 0.25,
    }  # fmt: skip
    nothing = {"count": 0, "p50": None, "p99": None, "worst": None}
    assert durations["request_to_frame"] == nothing


def test_no_timing_no_figures() -> None:
    shown_figures = figures(health(None))
    assert (shown_figures["durations"], shown_figures["not_counted"]) == ({}, {})


def test_the_table_in_milliseconds() -> None:
    shown = drawn(health())
    lines = {line.split("│")[1].strip(): line.split("│")[2:6] for line in shown.splitlines()
             if line.startswith("│")}  # fmt: skip
    cells = {name: [cell.strip() for cell in row] for name, row in lines.items()}
    assert cells == {
        "contact → BRAKE, the reflex": ["1", "4.200", "4.200", "4.200"],
        "bridge → BRAKE": ["100", "1.000", "10.000", "250.000"],
        "request → frame": ["0", "", "", ""],
        "of_a_newer_bridge": ["1", "0.500", "0.500", "0.500"],
    }
    assert "up for 61 s; not counted: 3 foreign_clock, 1 implausible" in shown


@pytest.mark.parametrize(
    ("newest", "silent", "message"),
    [
        (None, False, "waiting for the bridge"),
        (None, True, SILENCE),
        (health(), True, SILENCE),
        (health(Timing(bounds=(), durations={}, not_counted={})), False, "not counted: nothing"),
    ],
)
def test_captions_of_an_incomplete_table(newest: Health | None, silent: bool, message: str) -> None:
    assert message in drawn(newest, silent)


def test_json_lines_and_silence(capsys: pytest.CaptureFixture[str]) -> None:
    print_line(health(), False)
    print_line(health(), True)
    print_line(None, True)
    print_line(None, False)
    message = capsys.readouterr()
    assert [json.loads(line) for line in message.out.splitlines()] == [figures(health())]
    assert message.err == f"t2 latency: {SILENCE}\n" * 2


# --- silence ----------------------------------------------------------------------------------


def watched(once: bool) -> tuple[Watch, Loop, list[tuple[Health | None, bool]]]:
    shown: list[tuple[Health | None, bool]] = []
    loop = Loop()
    return Watch(loop, lambda newest, silent: shown.append((newest, silent)), once), loop, shown


def arrival(received_ns: int) -> Arrival[Health]:
    return Arrival(health(), "k", received_ns, None)


def test_silence_is_shown_once_after_each_health_message() -> None:
    watch, loop, shown = watched(once=False)
    begin_ns = clock.now_ns()
    watch.on_health(arrival(begin_ns))
    for seconds in (1, 4.9, 5.1, 6, 7):
        watch.check(begin_ns + round(seconds * NS_PER_S))
    assert shown == [(health(), False), (health(), True)]
    watch.on_health(arrival(begin_ns + 8 * NS_PER_S))
    watch.check(begin_ns + 9 * NS_PER_S)
    watch.check(begin_ns + 14 * NS_PER_S)
    assert shown[2:] == [(health(), False), (health(), True)]
    loop.close()


def test_once_stops_without_output_if_the_bridge_is_silent() -> None:
    watch, loop, shown = watched(once=True)
    watch.check(clock.now_ns() + 6 * NS_PER_S)
    loop.run()  # returns: it was stopped before
    assert (watch.silent, shown) == (True, [])
    loop.close()


def test_no_bridge_is_an_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(latency, "PATIENCE_S", 0.0)
    monkeypatch.setattr("signal.signal", lambda *_: None)  # pytest keeps its own ctrl-c
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    assert main(["latency", "--once", *sets(f"bus.connect={endpoint}")]) == EXIT_LINK
    assert f"t2 latency: no bridge at {endpoint}" in capsys.readouterr().err


# --- where it is shown ------------------------------------------------------------------------


def test_missing_rich_names_the_extra(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for module in ("rich.console", "rich.live"):
        monkeypatch.setitem(sys.modules, module, None)
    assert main(["latency", "--once"]) == 1
    message = capsys.readouterr().err
    assert message.startswith("t2 latency: the table needs rich")
    assert "pip install -e '.[demo]'" in message
    assert "t2 latency -o json" in message


def test_a_closed_pipe_ends_the_command_silently() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    publishers: list[Any] = []
    with router_process(endpoint), running(Loop()) as loop:

        def declare(bus: Any) -> None:
            publishers.append(bus.publisher(keys.HEALTH, service="bridge"))

        with bus_on(endpoint, loop, declare):
            loop.post(lambda: loop.every(0.02, lambda _: publishers[0].put(health())))
            with subprocess.Popen(
                t2("latency", "-o", "json", *sets(f"bus.connect={endpoint}")),
                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            ) as process:  # fmt: skip
                assert process.stdout is not None
                assert process.stderr is not None
                line = json.loads(process.stdout.readline())
                process.stdout.close()
                assert process.wait(PATIENCE_S) == 0
                assert process.stderr.read() == ""
    assert line["durations"]["contact_to_break"]["count"] == 1
