"""Display of the lap: map, state and results as text, and the plots."""

import io
from pathlib import Path

import pytest
from rich.console import Console, RenderableType

from cli.demo import plot
from cli.demo.display import STYLES, LapDisplay, RoomMap, panel, results_table
from cli.demo.record import LapRecord
from cli.demo.score import Trace
from common.settings import Vehicle
from sim.config import load_plan
from sim.geometry import Pose, Rectangle
from t2.messages import SafetyState, Ultrasonic, Velocity
from tests.cli.demo.lap_fixture import as_client, hit_lap, odometry, safety

PLAN = load_plan("office", Vehicle())
BODY = Rectangle(0.55, 0.35)
COLUMNS = 120


def text(what: RenderableType, columns: int = COLUMNS) -> str:
    console = Console(file=io.StringIO(), width=columns, record=True)
    console.print(what)
    return console.export_text()


@pytest.fixture
def record() -> LapRecord:
    """Return a record without steps and messages."""
    return LapRecord()


def seen(record: LapRecord) -> LapRecord:
    """Set the messages to those of a vehicle that safety has stopped before the wall."""
    record.steps += ["wait for safety", "drive off to the wall"]
    record.began_s = 0.0
    record.odometry += [odometry(x=0.2 * n) for n in range(16)]
    state = safety("blocked", text="Stopped short of what front sees.")
    record.safety = as_client(state, SafetyState)
    record.velocity = Velocity(linear=0.25, angular=-0.5)
    record.ranges = Ultrasonic(
        ranges=(1.5, 0.8, 0.21, None, None, None, 3.0, 2.0),
        status=("ok", "ok", "ok", "fault", "no_echo", "too_near", "ok", "ok"),
    )
    record.answers.append(("drive on", False, "Not gone yet: [bumper] was hit."))
    return record


# --- the live display -------------------------------------------------------------------------


def test_the_room_without_messages(record: LapRecord) -> None:
    shown = text(panel(RoomMap(PLAN, COLUMNS), record, 0.0))
    assert "T2 drives a lap" in shown
    assert shown.count("█") > 100
    assert "▒" in shown  # the low box, which sonar does not see
    assert not set("→↗↑↖←↙↓↘") & set(shown)
    assert "  0.0 s" in shown


def test_vehicle_verdict_and_causes(record: LapRecord) -> None:
    shown = text(panel(RoomMap(PLAN, COLUMNS), seen(record), 3.0))
    assert "→" in shown
    for words in (
        "✓ wait for safety",
        "▶ drive off to the wall",
        "STOP",
        "Stopped short of what front sees.",
        "  3.0 s",
        "0.25 m/s  -0.50 rad/s",
        "Not gone yet",
        "[bumper]",
        "0.21",
        "fault",
        "too_near",
        "▲",
    ):
        assert words in shown, words


@pytest.mark.parametrize("columns", [80, 100, 160])
def test_it_fits_the_terminal(record: LapRecord, columns: int) -> None:
    shown = text(panel(RoomMap(PLAN, columns), seen(record), 1.0), columns)
    lines = shown.splitlines()
    assert max(map(len, lines)) <= columns
    assert lines[0].startswith("╭")
    assert lines[-1].startswith("╰")


@pytest.mark.parametrize(
    ("heading", "arrow"),
    [(0.0, "→"), (0.8, "↗"), (1.57, "↑"), (3.14, "←"), (-3.14, "←"), (-1.57, "↓")],
)
def test_heading_of_the_vehicle(heading: float, arrow: str) -> None:
    assert arrow in RoomMap(PLAN, COLUMNS).render([], Pose(0.0, 0.0, heading)).plain


def test_every_verdict_has_its_style(record: LapRecord) -> None:
    for verdict in STYLES:
        record.safety = as_client(safety(verdict=verdict), SafetyState)
        assert verdict.upper() in text(panel(RoomMap(PLAN, COLUMNS), record, 0.0))


def test_failed_results_are_marked() -> None:
    shown = text(results_table([("fine", "1 m", True), ("bad", "2 m", False), ("as is", "", None)]))
    fine, bad, as_is = (line for line in shown.splitlines() if line.startswith("│"))
    assert "ok" in fine
    assert "WRONG" in bad
    assert "ok" not in as_is
    assert "WRONG" not in as_is


# --- without a terminal ---------------------------------------------------------


def display(out: Path) -> LapDisplay:
    return LapDisplay(PLAN, Vehicle(), out)


def test_without_a_terminal_steps_and_answers_are_lines(
    record: LapRecord, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with display(tmp_path) as it:
        it.show("A sentence [in brackets].")
        it.step("wait for safety")
        it.draw(seen(record), 1.0)
    it.results([("lap finished", "9 of 9", True)], record)
    shown = capsys.readouterr().out
    assert shown.startswith("starting simulator, router")
    assert "A sentence [in brackets]." in shown
    assert "  wait for safety\n" in shown
    assert "drive on: refused: Not gone yet: [bumper] was hit." in shown
    assert "9 of 9" in shown
    assert "╭" not in shown  # no live display


def test_live_display_on_a_terminal(
    record: LapRecord,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm-256color")
    with display(tmp_path) as it:
        it.step("wait for safety")
        it.draw(seen(record), 1.0)
    shown = capsys.readouterr().out
    assert "T2 drives a lap" in shown
    assert "starting simulator" not in shown
    assert shown.rindex("\x1b[?25h") > shown.rindex("\x1b[?25l")  # the cursor is visible again


# --- plots ---------------------------------------------------------------------------------


def test_plots(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    poses = [odometry(x=0.1 * n) for n in range(20)]
    display(tmp_path).plot(hit_lap(), poses)
    png, svg = tmp_path / "lap.png", tmp_path / "lap.svg"
    assert f"plots: {png}, {svg}\n" in capsys.readouterr().out
    assert png.read_bytes().startswith(b"\x89PNG")
    assert png.stat().st_size > 10_000
    drawn = svg.read_text(encoding="utf-8")
    assert drawn.rstrip().endswith("</svg>")
    for label in (
        "A lap of T2 through an office",
        "stopped by the bumper",
        "odometry",
        "too low for sonar",
    ):
        assert label in drawn, label


def test_plot_of_a_lap_without_a_hit(tmp_path: Path) -> None:
    calm = Trace(hit_lap().truth[:10], [], [])
    plot.save([tmp_path / "lap.svg"], PLAN, BODY, calm, [])
    assert "stopped by the bumper" not in (tmp_path / "lap.svg").read_text(encoding="utf-8")
