"""The operations guide lists every event and every alert of the code."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from common.messages import Level
from services.safety.core.causes import RULES, Clears
from services.safety.report import EVENT_NAMES
from tools.docs import DOCS

TREE = DOCS.parent
ROW = re.compile(r"^\| (\w+) \| `(\w+)` \| ([\w, ]+) \| (.+) \| (.+) \|$", re.MULTILINE)
LEVELS = set(Level.__args__)  # type: ignore[attr-defined]

Events = dict[tuple[str, str], set[str]]  # levels by service and name


def words(node: ast.expr) -> list[str]:
    """Return the possible string values of an expression, without its condition."""
    if isinstance(node, ast.IfExp):
        return words(node.body) + words(node.orelse)
    return [node.value] if isinstance(node, ast.Constant) and isinstance(node.value, str) else []


def calls(path: Path) -> Iterator[tuple[list[str], list[str]]]:
    """Yield names and levels of the calls that make an event.

    These are ``.event(...)``, ``Event(...)``, ``Transition(...)``, and the rules of teleop.
    """
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call) or len(node.args) < 2:
            continue
        name = getattr(node.func, "attr", "") or getattr(node.func, "id", "")
        if name in ("event", "Event", "Transition"):
            yield words(node.args[0]), words(node.args[1])
        elif name in ("_report", "_enforce") and "teleop" in path.parts:
            yield words(node.args[0]), ["warning"]


def events_of_the_code() -> Events:
    """Return every event of the code, without computed levels."""
    found: Events = {}
    for path in sorted((TREE / "services").rglob("*.py")):
        service = path.relative_to(TREE / "services").parts[0]
        for names, levels in calls(path):
            # Two names and two levels depend on one condition.
            each = [[level] for level in levels] if len(levels) > 1 else [levels] * len(names)
            for name, given in zip(names, each, strict=True):
                found.setdefault((service, name), set()).update(given)
    for rule in RULES:
        if rule.clears is Clears.RESET:
            found.setdefault(("safety", EVENT_NAMES.get(rule.name, rule.name)), set()).add("error")
    return found


def table() -> dict[tuple[str, str], tuple[set[str], str, str]]:
    """Return the rows of the guide: levels, meaning, action."""
    page = (DOCS / "operations.md").read_text(encoding="utf-8")
    part = page.partition("<!-- events -->")[2].partition("<!-- end -->")[0]
    rows = ROW.findall(part)
    assert len(rows) == part.count("\n| ") - 2, "a row has another format"
    return {(row[0], row[1]): (set(row[2].split(", ")), row[3], row[4]) for row in rows}


def test_the_guide_lists_exactly_the_events_of_the_code() -> None:
    code = events_of_the_code()
    assert {("bridge", "contact"), ("safety", "release_end"), ("recorder", "disk_full")} <= set(
        code
    )
    assert len(code) > 30
    assert set(table()) == set(code)


def test_the_guide_has_the_levels_of_the_code() -> None:
    code = events_of_the_code()
    for key, (levels, means, todo) in table().items():
        assert levels <= LEVELS, key
        assert code[key] <= levels, key
        assert means.strip(), key
        assert todo.strip(), key


def test_service_readmes_list_their_events() -> None:
    for service in ("bridge", "recorder"):
        page = (TREE / "services" / service / "README.md").read_text(encoding="utf-8")
        row = next(line for line in page.splitlines() if f"| `evt/{service}`" in line)
        assert set(re.findall(r"\w+", row.rpartition("|")[0].partition("evt/")[2])) >= {
            name for of, name in table() if of == service
        }


def test_the_guide_lists_every_alert() -> None:
    page = (DOCS / "operations.md").read_text(encoding="utf-8")
    rules = (TREE / "deploy" / "prometheus" / "alerts.yml").read_text(encoding="utf-8")
    alerts = set(re.findall(r"alert: (\w+)", rules))
    assert alerts
    assert alerts == set(re.findall(r"`(T2[A-Z]\w+)`", page))
