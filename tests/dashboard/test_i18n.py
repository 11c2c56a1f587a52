"""The catalogue is complete: every text that the page uses, in both languages."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import pytest

from common.root_cause import MAY_MOVE
from common.root_cause import TEXTS as ROOT_TEXTS
from services.bridge.core.lease import WAITING
from services.dashboard import server
from services.dashboard.driver_lock import HoldState
from services.dashboard.i18n import EVENTS, PHRASES, TEXTS, phrases
from services.safety.core.causes import RULES
from t2.messages import Direction, FaultName, LinkState, Verdict
from tools.docs import DOCS

CODE = Path(server.__file__).parent
HAN = re.compile("[\u4e00-\u9fff]")
MIXED = re.compile("[\u4e00-\u9fff] ?[,:;!?]|[，。：；？！] ")  # a mark of the other script


def used_keys() -> set[str]:
    """Return every key that the page, a script or the server names literally."""
    page = (CODE / "static" / "index.html").read_text(encoding="utf-8")
    found = set(re.findall(r'data-t(?:-\w+)?="(\w+)"', page))
    for script in (CODE / "static").glob("*.js"):
        text = script.read_text(encoding="utf-8")
        found |= set(re.findall(r'\bt\("([\w.]+)"[,)]', text))
        found |= set(re.findall(r'toast\("(\w+)"', text))
        found |= set(re.findall(r'"(release_\w+)"', text))
        found |= set(re.findall(r'\btext\((?:it\.sent \? )?"(\w+)"', text))
    for name in ("fleet.py", "robot_page.py", "robot.py"):
        code = (CODE / name).read_text(encoding="utf-8")
        found |= set(re.findall(r'"(?:error|info|warning)", "(\w+)"', code))
    return found


def test_every_used_key_has_a_text() -> None:
    used = used_keys()
    assert {"estop", "too_late", "also_latched"} <= used  # of the page, a script, the server
    assert used <= set(TEXTS)


@pytest.mark.parametrize(
    ("prefix", "names"),
    [
        ("verdict", [*get_args(Verdict), "none", "lost", "no_router"]),
        ("text", ["none", "lost", "no_router"]),
        ("link", [*get_args(LinkState), "none", "missing"]),
        ("fault", [*get_args(FaultName), "reserved"]),
        ("hold", [*HoldState, "waiting", "slow", "still", "frozen"]),
        ("bumper", ["true", "false", "none"]),
    ],
)
def test_every_name_of_the_messages_has_its_text(prefix: str, names: list[str]) -> None:
    assert {f"{prefix}.{getattr(name, 'value', name)}" for name in names} <= set(TEXTS)


def test_what_the_bridge_waits_for_has_its_text() -> None:
    assert set(WAITING.values()) <= set(PHRASES)


def test_the_causes_have_the_texts_of_safety_and_each_direction_its_texts() -> None:
    for rule in RULES:
        assert TEXTS[f"cause.{rule.name}"][0] == rule.text
    for part, text in [*ROOT_TEXTS.items(), ("may_move", MAY_MOVE)]:
        assert TEXTS[f"root.{part}"][0] == text
    directions = get_args(Direction)
    for prefix in ("release", "release_forbidden", "believed"):
        assert {f"{prefix}_{direction}" for direction in directions} <= set(TEXTS)


def events_of_the_guide() -> list[tuple[str, str]]:
    """Return service and name of every event in the guide to operations."""
    page = (DOCS / "operations.md").read_text(encoding="utf-8")
    part = page.partition("<!-- events -->")[2].partition("<!-- end -->")[0]
    events = re.findall(r"^\| (\w+) \| `(\w+)` \|", part, re.MULTILINE)
    assert len(events) > 40
    return [*events, ("bridge", "drive_link_up"), ("safety", "drive_link_lost")]


def test_every_event_has_its_text() -> None:
    for service, name in events_of_the_guide():
        assert {f"event.{service}.{name}", f"event.{name}"} & set(EVENTS), name


SENTENCES = re.compile(r"(?<=[.!?]) (?=[A-Za-z])")  # as in phrases.js
# Texts for programs, and for the terminal alone.
NOT_SHOWN = re.compile(
    "X: X|Latched: .*|The reset names no cause.|reset not sent: .*|key .* ignored: .*|cmd_vel of .*"
)


def literals(tree: ast.AST) -> Iterator[str]:
    """Yield the texts below a node, with X in place of each value; no docstrings."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.JoinedStr):
            parts = (it.value if isinstance(it, ast.Constant) else "X" for it in node.values)
            yield re.sub("^X (?=[A-Z])", "", "".join(map(str, parts)))
        elif isinstance(node, ast.Constant):
            yield str(node.value)
        elif not isinstance(node, ast.Expr) or not isinstance(node.value, ast.Constant):
            yield from literals(node)


def texts_of_services() -> Iterator[str]:
    """Yield the sentences of safety, and the texts of all events."""
    for file in CODE.parent.rglob("*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        if "safety" in file.parts:
            yield from (it for it in literals(tree) if re.fullmatch(r"[A-Z].+ .+\.", it))
        calls = (it for it in ast.walk(tree) if isinstance(it, ast.Call))
        for call in calls:
            if ast.unparse(call.func).lower().endswith("event"):
                yield from literals(ast.Tuple(call.args[2:]))


def test_every_text_of_a_service_has_its_chinese() -> None:
    patterns = (re.escape(it).replace(r"\{\}", ".+?") for it in phrases())
    known = re.compile("|".join(patterns))
    sentences = [one for it in texts_of_services() for one in SENTENCES.split(it) if " " in one]
    assert len(sentences) > 80
    for one in sentences:
        assert known.fullmatch(one) or NOT_SHOWN.fullmatch(one), one


def test_every_result_of_a_call_has_its_text() -> None:
    robot = (CODE / "robot.py").read_text(encoding="utf-8")
    found = re.findall(r'(?:reason|text|done\.text), "(\w+)"\)', robot)
    assert {"reset_refused", "reset_done", "reset_partial"} == set(found)
    assert {f"event.{name}" for name in found} <= set(EVENTS)


def test_both_languages_have_each_text() -> None:
    for key, (english, chinese) in TEXTS.items():
        assert english.strip(), key
        if key != "language":  # each names the other one
            assert not HAN.search(english), key
            assert HAN.search(chinese), key
            assert not MIXED.search(chinese), key
    assert all(map(HAN.search, EVENTS.values()))
    for english, chinese in PHRASES.items():
        assert HAN.search(chinese), english
        assert not MIXED.search(chinese), english
        assert chinese.count("{}") == english.count("{}"), english
