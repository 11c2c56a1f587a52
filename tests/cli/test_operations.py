"""What the guide to operations names is there, and every event of the code is in it."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from common.messages import Level
from services.safety.causes import RULES, Clears
from services.safety.report import EVENT_NAMES
from tools.docs import DOCS

TREE = DOCS.parent
ROW = re.compile(r"^\| (\w+) \| `(\w+)` \| ([\w, ]+) \| (.+) \| (.+) \|$", re.MULTILINE)
LEVELS = set(Level.__args__)  # type: ignore[attr-defined]

Told = dict[tuple[str, str], set[str]]  # levels by service and name


def words(node: ast.expr) -> list[str]:
    """Return the strings that an expression may be, without those of its condition."""
    if isinstance(node, ast.IfExp):
        return words(node.body) + words(node.orelse)
    return [node.value] if isinstance(node, ast.Constant) and isinstance(node.value, str) else []


def calls(path: Path) -> Iterator[ast.Call]:
    """Yield the calls that tell of an event: ``node.event(...)`` and safety's ``Note(...)``."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            name = getattr(node.func, "attr", "") or getattr(node.func, "id", "")
            if name in ("event", "Note"):
                yield node


def told() -> Told:
    """Return every event of the code; levels that are worked out are left out."""
    found: Told = {}
    for path in sorted((TREE / "services").rglob("*.py")):
        service = path.relative_to(TREE / "services").parts[0]
        for call in calls(path):
            names, levels = words(call.args[0]), words(call.args[1])
            # Two names and two levels go by one condition.
            each = [[level] for level in levels] if len(levels) > 1 else [levels] * len(names)
            for name, given in zip(names, each, strict=True):
                found.setdefault((service, name), set()).update(given)
    for rule in RULES:
        if rule.clears is Clears.RESET:
            found.setdefault(("safety", EVENT_NAMES.get(rule.name, rule.name)), set()).add("error")
    return found


def table() -> dict[tuple[str, str], tuple[set[str], str, str]]:
    """Return the rows of the guide: levels, what it means, what to do."""
    page = (DOCS / "operations.md").read_text(encoding="utf-8")
    part = page.partition("<!-- events -->")[2].partition("<!-- end -->")[0]
    rows = ROW.findall(part)
    assert len(rows) == part.count("\n| ") - 2, "a row is not as the others are"
    return {(row[0], row[1]): (set(row[2].split(", ")), row[3], row[4]) for row in rows}


def test_every_event_of_the_code_is_told_and_no_other() -> None:
    code = told()
    assert {("bridge", "contact"), ("safety", "release_end"), ("recorder", "disk_full")} <= set(
        code
    )
    assert len(code) > 30
    assert set(table()) == set(code)


def test_an_event_has_the_level_that_the_code_gives_it() -> None:
    code = told()
    for key, (levels, means, todo) in table().items():
        assert levels <= LEVELS, key
        assert code[key] <= levels, key
        assert means.strip(), key
        assert todo.strip(), key


def test_the_services_name_their_events_as_the_guide_does() -> None:
    for service in ("bridge", "recorder"):
        page = (TREE / "services" / service / "README.md").read_text(encoding="utf-8")
        row = next(line for line in page.splitlines() if f"| `evt/{service}`" in line)
        assert set(re.findall(r"\w+", row.rpartition("|")[0].partition("evt/")[2])) >= {
            name for of, name in table() if of == service
        }


def test_every_alert_is_told() -> None:
    page = (DOCS / "operations.md").read_text(encoding="utf-8")
    rules = (TREE / "deploy" / "prometheus" / "alerts.yml").read_text(encoding="utf-8")
    alerts = set(re.findall(r"alert: (\w+)", rules))
    assert alerts
    assert alerts == set(re.findall(r"`(T2[A-Z]\w+)`", page))
