"""Display of the lap: a live map on a terminal, one line per step elsewhere, and the results."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Self

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from cli.demo import plot
from cli.demo.record import LapRecord
from cli.demo.score import Result, Trace
from common.messages import SONAR_NAMES
from common.settings import Vehicle
from sim.geometry import Pose, Rectangle, Segment
from sim.world import Plan, World
from t2.messages import Odometry, Ultrasonic

SIDE_COLUMNS = 46
FRAME_COLUMNS = 6
COLUMNS_MAX = 58
ROWS_PER_COLUMN = 0.38  # aspect ratio of a character
ARROWS = "→↗↑↖←↙↓↘"
STYLES = {"run": "bold green", "slow": "bold yellow", "stop": "bold red",
          "brake": "bold white on red", "inhibited": "bold magenta"}  # fmt: skip


class LapDisplay:
    """Display of one lap; a context manager, because the live map must restore the terminal."""

    def __init__(self, plan: Plan, vehicle: Vehicle, out: Path) -> None:
        self._plan = plan
        self._body = Rectangle(vehicle.length / 2, vehicle.width / 2)
        self._out = out
        self._console = Console(highlight=False, markup=False)  # texts may contain brackets
        self._map = RoomMap(plan, self._console.width)
        self._live = Live(console=self._console, auto_refresh=False, transient=True)

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._live.start()
        else:
            self._console.print("starting simulator, router, bridge, safety and odometry")
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def show(self, text: str) -> None:
        """Print a line."""
        self._console.print(text)

    def step(self, name: str) -> None:
        """Print the start of a step, except on a terminal."""
        if not self._console.is_terminal:
            self._console.print(f"  {name}")

    def draw(self, record: LapRecord, now_s: float) -> None:
        """Redraw the live display."""
        if self._console.is_terminal:
            self._live.update(panel(self._map, record, now_s), refresh=True)

    def results(self, rows: Sequence[Result], record: LapRecord) -> None:
        """Print the results, and safety's answers."""
        for step, granted, text in record.answers:
            self._console.print(f"{step}: {'granted' if granted else 'refused'}: {text}")
        self._console.print(results_table(list(rows)))

    def plot(self, trace: Trace, odometry: Sequence[Odometry]) -> None:
        """Write the plots and print their names."""
        files = [self._out / "lap.png", self._out / "lap.svg"]
        plot.save(files, self._plan, self._body, trace, odometry)
        self._console.print(f"plots: {', '.join(map(str, files))}", soft_wrap=True)


class RoomMap:
    """Map of a room in characters; y is up."""

    def __init__(self, plan: Plan, console_columns: int) -> None:
        free = console_columns - SIDE_COLUMNS - FRAME_COLUMNS
        self._columns = max(24, min(COLUMNS_MAX, free))
        self._rows = round(self._columns * ROWS_PER_COLUMN)
        world = World.of(plan)
        points = [(s.ax, s.ay) for s in world.solid] + [(s.bx, s.by) for s in world.solid]
        self._left = min(x for x, _ in points)
        self._top = max(y for _, y in points)
        width = max(x for x, _ in points) - self._left
        height = self._top - min(y for _, y in points)
        self._per_column = width / (self._columns - 1)
        self._per_row = height / (self._rows - 1)
        self._room: dict[tuple[int, int], tuple[str, str]] = {}
        low = [segment for box in plan.boxes if box.low for segment in box.shape.outline(box.pose)]
        for segment in world.solid:
            mark = ("▒", "yellow") if segment in low else ("█", "bright_black")
            self._draw(segment, mark)

    def render(self, path: list[tuple[float, float]], pose: Pose | None) -> Text:
        """Return the room with the path and the vehicle."""
        cells = dict.fromkeys((self._cell(x, y) for x, y in path), ("·", "cyan")) | self._room
        if pose is not None:
            turn = round(pose.heading / (math.pi / 4)) % 8
            cells[self._cell(pose.x, pose.y)] = (ARROWS[turn], "bold bright_green")
        text = Text()
        for row in range(self._rows):
            for column in range(self._columns):
                text.append(*cells.get((column, row), (" ", "")))
            text.append("\n")
        return text

    def _draw(self, segment: Segment, mark: tuple[str, str]) -> None:
        length = math.hypot(segment.bx - segment.ax, segment.by - segment.ay)
        steps = max(1, round(length / min(self._per_column, self._per_row) * 2))
        for step in range(steps + 1):
            part = step / steps
            x = segment.ax + part * (segment.bx - segment.ax)
            y = segment.ay + part * (segment.by - segment.ay)
            self._room[self._cell(x, y)] = mark

    def _cell(self, x: float, y: float) -> tuple[int, int]:
        return round((x - self._left) / self._per_column), round((self._top - y) / self._per_row)


def panel(room: RoomMap, record: LapRecord, now_s: float) -> RenderableType:
    """Return the live display at one monotonic time."""
    poses = record.odometry
    path = [(p.x, p.y) for p in poses[::10]]
    pose = Pose(poses[-1].x, poses[-1].y, poses[-1].heading) if poses else None
    side = Group(_steps(record, now_s), Text(), _state(record), Text(), _ranges(record.ranges))
    grid = Table.grid(padding=(0, 2))
    grid.add_column()
    grid.add_column(width=SIDE_COLUMNS)
    grid.add_row(room.render(path, pose), side)
    return Panel(grid, title="T2 drives a lap", border_style="bright_black", expand=False)


def results_table(rows: list[Result], title: str = "The lap") -> Table:
    """Return the results as a table."""
    table = Table(title=title, title_justify="left", show_header=False)
    marks = {True: Text("ok", "green"), False: Text("WRONG", "bold red"), None: Text("")}
    for what, amount, fine in rows:
        table.add_row(what, Text(amount, justify="right"), marks[fine])
    return table


def _steps(record: LapRecord, now_s: float) -> Text:
    passed_s = 0.0 if record.began_s is None else now_s - record.began_s
    text = Text(f"{passed_s:5.1f} s\n", "bold")
    *done, current = record.steps or [""]
    for name in done:
        text.append(f"✓ {name}\n", "green")
    return text.append(f"▶ {current}\n", "bold")


def _state(record: LapRecord) -> RenderableType:
    table = Table.grid(padding=(0, 1))
    measured, safety = record.velocity, record.safety
    if measured is not None:
        table.add_row("measured", f"{measured.linear:5.2f} m/s  {measured.angular:5.2f} rad/s")
    if safety is not None:
        table.add_row("safety", Text(safety.verdict.upper(), STYLES[safety.verdict]))
        table.add_row("", Text(safety.text, overflow="fold"))
    if record.answers:
        _, granted, answer = record.answers[-1]
        result, style = ("granted", "green") if granted else ("refused", "yellow")
        table.add_row(result, Text(answer, style))
    return table


def _ranges(ranges: Ultrasonic | None) -> RenderableType:
    if ranges is None:
        return Text()
    near = {name: (value, state) for name, value, state in
            zip(SONAR_NAMES, ranges.ranges, ranges.status, strict=True)}  # fmt: skip

    def cell(name: str) -> Text:
        value, state = near[name]
        if value is None:
            return Text("-" if state == "no_echo" else state, "bright_black")
        return Text(f"{value:.2f}", "red" if value < 0.3 else "yellow" if value < 1.0 else "green")

    table = Table.grid(padding=(0, 2))
    table.add_row(cell("front_left"), cell("front"), cell("front_right"))
    table.add_row(cell("left"), Text("▲", "bold"), cell("right"))
    table.add_row(cell("rear_left"), cell("rear"), cell("rear_right"))
    return table
