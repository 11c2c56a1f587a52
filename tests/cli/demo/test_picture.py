"""The lap as text: room, vehicle, verdict, reasons, results; on paper: files with something in."""

import io
from pathlib import Path

import pytest
from rich.console import Console, RenderableType

from cli.demo import plot
from cli.demo.driver import Driver
from cli.demo.picture import STYLES, Canvas, picture, results_table
from cli.demo.score import Trace
from cli.demo.script import Lap, lap
from cli.demo.show import Show
from common.bus.bus import Bus
from common.freshness import NS_PER_S
from common.messages import Ultrasonic, Velocity
from common.motion import Twist
from common.settings import Vehicle
from sim.files import load_plan
from sim.geometry import Pose, Rectangle
from tests.cli.demo.lap_fixture import hit_lap, odometry, safety
from verification.harness.support import at

PLAN = load_plan("office", Vehicle())
BODY = Rectangle(0.55, 0.35)
COLUMNS = 120


def text(what: RenderableType, columns: int = COLUMNS) -> str:
    console = Console(file=io.StringIO(), width=columns, record=True)
    console.print(what)
    return console.export_text()


@pytest.fixture
def driver() -> Driver:
    """Return a driver without a bus, who has seen nothing yet."""
    bus = Bus(at("tcp/127.0.0.1:1"), "001", lambda call: call())
    return Driver(bus, Lap(lap(fast=True)), lambda _: None)


def seen(driver: Driver) -> Driver:
    """Let the driver have seen the vehicle stopped short of the wall."""
    driver.odometry += [odometry(x=0.2 * n) for n in range(16)]
    driver.safety = safety("blocked", text="Stopped short of what front sees.")
    driver.velocity = Velocity(linear=0.25, angular=-0.5)
    driver.ranges = Ultrasonic(
        ranges=(1.5, 0.8, 0.21, None, None, None, 3.0, 2.0),
        status=("ok", "ok", "ok", "fault", "no_echo", "too_near", "ok", "ok"),
    )
    driver.lap.index = 1
    driver.asked = Twist(0.5, 0.1)
    driver.answers.append(("drive on", "reset", False, "Not gone yet: [bumper] was hit."))
    return driver


# --- the picture ------------------------------------------------------------------------------


def test_the_room_stands_before_anything_is_known(driver: Driver) -> None:
    shown = text(picture(Canvas(PLAN, COLUMNS), driver, 0))
    assert "T2 drives a lap" in shown
    assert shown.count("█") > 100
    assert "▒" in shown  # the low box, which sonar does not see
    assert not set("→↗↑↖←↙↓↘") & set(shown)
    assert "  0.0 s" in shown


def test_vehicle_verdict_and_reasons_are_in_it(driver: Driver) -> None:
    shown = text(picture(Canvas(PLAN, COLUMNS), seen(driver), 3 * NS_PER_S))
    assert "→" in shown
    for words in (
        "✓ wait for safety",
        "▶ drive off to the wall",
        "STOP",
        "Stopped short of what front sees.",
        "0.50 m/s   0.10 rad/s",
        "0.25 m/s  -0.50 rad/s",
        "refused: Not gone yet",
        "[bumper]",
        "0.21",
        "fault",
        "too_near",
        "▲",
    ):
        assert words in shown, words


@pytest.mark.parametrize("columns", [80, 100, 160])
def test_it_fits_the_terminal(driver: Driver, columns: int) -> None:
    shown = text(picture(Canvas(PLAN, columns), seen(driver), NS_PER_S), columns)
    lines = shown.splitlines()
    assert max(map(len, lines)) <= columns
    assert lines[0].startswith("╭")
    assert lines[-1].startswith("╰")


@pytest.mark.parametrize(
    ("heading", "arrow"),
    [(0.0, "→"), (0.8, "↗"), (1.57, "↑"), (3.14, "←"), (-3.14, "←"), (-1.57, "↓")],
)
def test_the_vehicle_looks_where_it_heads(heading: float, arrow: str) -> None:
    assert arrow in Canvas(PLAN, COLUMNS).picture([], Pose(0.0, 0.0, heading)).plain


def test_every_verdict_has_its_style(driver: Driver) -> None:
    for verdict in STYLES:
        driver.safety = safety(verdict=verdict)
        assert verdict.upper() in text(picture(Canvas(PLAN, COLUMNS), driver, 0))


def test_results_say_what_is_wrong() -> None:
    shown = text(results_table([("fine", "1 m", True), ("bad", "2 m", False), ("as is", "", None)]))
    fine, bad, as_is = (line for line in shown.splitlines() if line.startswith("│"))
    assert "ok" in fine
    assert "WRONG" in bad
    assert "ok" not in as_is
    assert "WRONG" not in as_is


# --- what is shown without a terminal ---------------------------------------------------------


def show(out: Path) -> Show:
    return Show(PLAN, Vehicle(), out)


def test_without_a_terminal_steps_and_answers_are_lines(
    driver: Driver, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with show(tmp_path) as it:
        it.say("A sentence [in brackets].")
        it.step(driver.lap.steps[0])
        it.draw(seen(driver), NS_PER_S)
    it.results([("lap finished", "9 of 9", True)], driver)
    shown = capsys.readouterr().out
    assert shown.startswith("starting simulator, router")
    assert "A sentence [in brackets]." in shown
    assert "  wait for safety\n" in shown
    assert "drive on: reset refused: Not gone yet: [bumper] was hit." in shown
    assert "9 of 9" in shown
    assert "╭" not in shown  # no picture


def test_on_a_terminal_the_picture_is_live(
    driver: Driver,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm-256color")
    with show(tmp_path) as it:
        it.step(driver.lap.steps[0])
        it.draw(seen(driver), NS_PER_S)
    shown = capsys.readouterr().out
    assert "T2 drives a lap" in shown
    assert "starting simulator" not in shown
    assert shown.rindex("\x1b[?25h") > shown.rindex("\x1b[?25l")  # the cursor is back


# --- on paper ---------------------------------------------------------------------------------


def test_the_plot_is_named_and_has_something_in(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    poses = [odometry(x=0.1 * n) for n in range(20)]
    show(tmp_path).plot(hit_lap(), poses)
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


def test_a_lap_that_hit_nothing_can_be_drawn(tmp_path: Path) -> None:
    calm = Trace(hit_lap().truth[:10], [], [])
    plot.save([tmp_path / "lap.svg"], PLAN, BODY, calm, [])
    assert "stopped by the bumper" not in (tmp_path / "lap.svg").read_text(encoding="utf-8")
