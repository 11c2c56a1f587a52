"""The catalogue is complete: every text that the page uses, in both languages."""

import re
from pathlib import Path
from typing import get_args

import pytest

from common.messages import Direction, FaultName, LinkState, Verdict
from services.dashboard import server
from services.dashboard.driver_lock import HoldState
from services.dashboard.i18n import PHRASES, PLACEHOLDER, TEXTS
from services.safety.core.causes import RULES
from tools.docs import DOCS

CODE = Path(server.__file__).parent
HAN = re.compile("[\u4e00-\u9fff]")


def used_keys() -> set[str]:
    """Return every key that the page, a script or the server names literally."""
    page = (CODE / "static" / "index.html").read_text(encoding="utf-8")
    found = set(re.findall(r'data-t(?:-\w+)?="(\w+)"', page))
    for script in (CODE / "static").glob("*.js"):
        text = script.read_text(encoding="utf-8")
        found |= set(re.findall(r'\bt\("([\w.]+)"\)', text))
        found |= set(re.findall(r'toast\("(\w+)"', text))
        found |= set(re.findall(r'"(release_\w+|moved_\w+|believed_\w+)"', text))
    for name in ("fleet.py", "robot_page.py", "robot.py"):
        code = (CODE / name).read_text(encoding="utf-8")
        found |= set(re.findall(r'"(?:error|info|warning)", "(\w+)"', code))
    return found


def test_every_used_key_has_a_text() -> None:
    used = used_keys()
    assert {"estop", "too_late", "release_due"} <= used  # of the page, a script, the server
    assert used <= set(TEXTS)


@pytest.mark.parametrize(
    ("prefix", "names"),
    [
        ("cause", [rule.name for rule in RULES]),
        ("verdict", [*get_args(Verdict), "none", "lost", "no_router"]),
        ("text", ["none", "lost", "no_router"]),
        ("link", [*get_args(LinkState), "none"]),
        ("fault", [*get_args(FaultName), "reserved"]),
        ("hold", list(HoldState)),
        ("bumper", ["true", "false", "none"]),
    ],
)
def test_every_name_of_the_messages_has_its_text(prefix: str, names: list[str]) -> None:
    assert {f"{prefix}.{getattr(name, 'value', name)}" for name in names} <= set(TEXTS)


def events_of_the_guide() -> list[tuple[str, str]]:
    """Return service and name of every event in the guide to operations."""
    page = (DOCS / "operations.md").read_text(encoding="utf-8")
    part = page.partition("<!-- events -->")[2].partition("<!-- end -->")[0]
    events = re.findall(r"^\| (\w+) \| `(\w+)` \|", part, re.MULTILINE)
    assert len(events) > 40
    return [*events, ("bridge", "drive_link_up"), ("safety", "drive_link_lost")]


@pytest.mark.parametrize(("service", "name"), events_of_the_guide())
def test_every_event_has_its_text(service: str, name: str) -> None:
    assert {f"event.{service}.{name}", f"event.{name}"} & set(TEXTS)


def test_every_result_of_a_call_has_its_text() -> None:
    robot = (CODE / "robot.py").read_text(encoding="utf-8")
    found = re.findall(r'(?:reason|text|done\.text), "(\w+)"\)', robot)
    assert {
        "reset_refused",
        "reset_done",
        "reset_partial",
        "call_refused",
    } == {name for name in found if name}
    assert {f"event.{name}" for name in found} <= set(TEXTS)


@pytest.mark.parametrize("direction", get_args(Direction))
def test_every_direction_has_its_texts(direction: str) -> None:
    for prefix in ("release", "release_forbidden", "believed", "moved"):
        assert f"{prefix}_{direction}" in TEXTS


def test_the_english_causes_are_those_of_safety() -> None:
    assert {rule.name: rule.text for rule in RULES} == {
        rule.name: TEXTS[f"cause.{rule.name}"][0] for rule in RULES
    }


@pytest.mark.parametrize("key", TEXTS)
def test_both_languages_have_a_text(key: str) -> None:
    english, chinese = TEXTS[key]
    assert english.strip()
    assert chinese.strip()
    if key != "language":  # each names the other one
        assert not HAN.search(english)
        assert HAN.search(chinese)


@pytest.mark.parametrize("english", PHRASES)
def test_a_phrase_has_the_same_placeholders_in_both_languages(english: str) -> None:
    chinese = PHRASES[english]
    assert HAN.search(chinese)
    assert chinese.count(PLACEHOLDER) == english.count(PLACEHOLDER)
