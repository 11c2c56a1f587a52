"""Layout in cells: a Chinese character takes two columns."""

import pytest
from rich.cells import cell_len

from services.teleop.cells import centred, fitted, left, right, wrap

NEXT = "主控板无应答：请检查其电源和线缆。下一步：`t2 doctor`"


@pytest.mark.parametrize(
    ("text", "columns", "indent", "rows"),
    [
        ("", 10, 0, []),
        ("The bumper was hit.", 11, 0, ["The bumper", "was hit."]),
        ("The bumper was hit.", 11, 8, ["The", "bumper was", "hit."]),
        ("bumper", 6, 3, ["", "bumper"]),
        ("x" * 25, 10, 3, ["", "x" * 10, "x" * 10, "x" * 5]),
        ("防撞条已触发。", 8, 0, ["防撞条已", "触发。"]),
        ("防撞条已触发。", 12, 0, ["防撞条已触", "发。"]),  # no row begins with a full stop
        ("防撞条（前）", 8, 0, ["防撞条", "（前）"]),  # or ends with an opening bracket
        ("run `t2 doctor` now", 9, 0, ["run", "`t2 docto", "r` now"]),
        ("run `t2 doctor` now", 11, 0, ["run", "`t2 doctor`", "now"]),  # a command is one word
        (NEXT, 30, 12, ["主控板无应答：请检", "查其电源和线缆。下一步：", "`t2 doctor`"]),
    ],
)
def test_wrap(text: str, columns: int, indent: int, rows: list[str]) -> None:
    assert wrap(text, columns, indent) == rows
    assert all(cell_len(row) <= columns for row in rows)


def test_columns() -> None:
    assert fitted("急停未被确认", 12) == "急停未被确认"
    assert fitted("急停未被确认", 8) == "急停未…"
    assert left("急停", 6) == "急停  "
    assert right("急停", 6) == "  急停"
    assert centred("急停", 7) == " 急停  "
    assert left("急停未被确认", 5) == "急停…"
