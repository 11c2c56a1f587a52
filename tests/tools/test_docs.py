"""The documents name only files, tests, keys and settings that exist."""

import ast
import re
from pathlib import Path

from common.config import Sources, load
from common.settings import Shared
from services.safety.causes import RULES
from tools.docs import DOCS, kinds

TREE = DOCS.parent
NAMED = re.compile(r"`(tests/[\w/]+\.py)(?:::(\w+))?`")
HAZARD = re.compile(r"^\|(?P<cells>.*`tests/.*)\|$", re.MULTILINE)


def test_every_schema_has_a_struct() -> None:
    names = {path.stem for path in (DOCS / "schemas").glob("*.json")}
    assert names == {kind.__name__ for kind in kinds()}


def test_every_field_is_documented() -> None:
    page = (DOCS / "bus.md").read_text(encoding="utf-8")
    for kind in kinds():
        assert f"### {kind.__name__}\n" in page
        for name in kind.__annotations__:
            assert f"| `{name}` |" in page, f"{kind.__name__}.{name}"


def case() -> str:
    return (DOCS / "safety.md").read_text(encoding="utf-8")


def functions_in(path: Path) -> set[str]:
    """Return the names of the functions in a file."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def test_every_test_in_the_safety_case_exists() -> None:
    named = set(NAMED.findall(case()))
    assert len(named) > 30
    for file, name in sorted(named):
        assert (TREE / file).is_file(), file
        if name:
            assert name in functions_in(TREE / file), f"{file}::{name}"


def test_every_hazard_has_a_barrier_and_a_test() -> None:
    rows = [found["cells"].split("|") for found in HAZARD.finditer(case())]
    assert len(rows) > 15
    for cells in rows:
        hazard, cause, barriers, tests, _ = (cell.strip() for cell in cells)
        assert hazard, cells
        assert cause, hazard
        assert barriers, hazard
        assert NAMED.search(tests), hazard


def test_every_cause_is_in_the_safety_case() -> None:
    for rule in RULES:
        assert f"| `{rule.name}` | {rule.action.upper()} |" in case(), rule.name


def test_the_settings_of_a_fleet_robot_are_valid(tmp_path: Path) -> None:
    page = (DOCS / "fleet.md").read_text(encoding="utf-8")
    file = tmp_path / "robot.toml"
    file.write_text(page.partition("```toml\n")[2].partition("```")[0], encoding="utf-8")
    bus = load(Shared, Sources(files=(file,), environ={})).config.bus
    assert bus.uplink == ("tls/site.example:7447",)
