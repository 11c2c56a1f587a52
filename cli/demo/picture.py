"""The lap in a terminal: the room from above, the vehicle in it, and what safety says."""

import math

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from cli.demo.driver import Driver
from cli.demo.score import Result
from common.messages import SONAR_NAMES, Ultrasonic
from sim.geometry import Pose, Segment
from sim.world import Plan, World

SIDE_COLUMNS = 46
FRAME_COLUMNS = 6
COLUMNS_MAX = 58
ROWS_PER_COLUMN = 0.38  # a character is higher than wide
ARROWS = "→↗↑↖←↙↓↘"
STYLES = {"run": "bold green", "slow": "bold yellow", "stop": "bold red",
          "brake": "bold white on red", "inhibited": "bold magenta"}  # fmt: skip
BODY = Pose(0.0, 0.0, 0.0)


class Canvas:
    """A room in characters; y is up."""

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

    def picture(self, way: list[tuple[float, float]], pose: Pose | None) -> Text:
        """Return the room with the way so far and the vehicle."""
        cells = dict.fromkeys((self._cell(x, y) for x, y in way), ("·", "cyan")) | self._room
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


def picture(canvas: Canvas, driver: Driver, now_ns: int) -> RenderableType:
    """Return the whole picture of one moment."""
    poses = driver.odometry
    way = [(p.x, p.y) for p in poses[::10]]
    pose = Pose(poses[-1].x, poses[-1].y, poses[-1].heading) if poses else None
    side = Group(_steps(driver, now_ns), Text(), _state(driver), Text(), _ranges(driver.ranges))
    grid = Table.grid(padding=(0, 2))
    grid.add_column()
    grid.add_column(width=SIDE_COLUMNS)
    grid.add_row(canvas.picture(way, pose), side)
    return Panel(grid, title="T2 drives a lap", border_style="bright_black", expand=False)


def results_table(rows: list[Result], title: str = "The lap") -> Table:
    """Return the results as a table."""
    table = Table(title=title, title_justify="left", show_header=False)
    marks = {True: Text("ok", "green"), False: Text("WRONG", "bold red"), None: Text("")}
    for what, amount, fine in rows:
        table.add_row(what, Text(amount, justify="right"), marks[fine])
    return table


def _steps(driver: Driver, now_ns: int) -> Text:
    lap = driver.lap
    text = Text(f"{lap.seconds(now_ns):5.1f} s\n", "bold")
    for index, step in enumerate(lap.steps):
        done, current = index < lap.index, index == lap.index
        mark = "✓" if done else "▶" if current else " "
        style = "green" if done else "bold" if current else "bright_black"
        text.append(f"{mark} {step.name}\n", style)
    return text


def _state(driver: Driver) -> RenderableType:
    table = Table.grid(padding=(0, 1))
    measured = driver.velocity
    table.add_row("asked", f"{driver.asked.linear:5.2f} m/s  {driver.asked.angular:5.2f} rad/s")
    if measured is not None:
        table.add_row("measured", f"{measured.linear:5.2f} m/s  {measured.angular:5.2f} rad/s")
    if driver.safety is not None:
        safety = driver.safety
        table.add_row("safety", Text(safety.verdict.upper(), STYLES[safety.verdict]))
        table.add_row("", Text(safety.text, overflow="fold"))
    if driver.answers:
        _, press, granted, words = driver.answers[-1]
        said = "granted" if granted else "refused"
        table.add_row(press, Text(f"{said}: {words}", "green" if granted else "yellow"))
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
