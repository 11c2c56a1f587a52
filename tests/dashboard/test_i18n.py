"""Both languages are whole: every text that is asked for is there, in each of them."""

import re
from pathlib import Path
from typing import get_args

import pytest

from common.messages import Direction, FaultName, LinkState, Verdict
from services.dashboard import server
from services.dashboard.auth import asking
from services.dashboard.driver_lock import Grip
from services.dashboard.i18n import LANGUAGES, TEXTS, table
from services.safety.causes import RULES

CODE = Path(server.__file__).parent
HAN = re.compile("[\u4e00-\u9fff]")


def asked_for() -> set[str]:
    """Return every key that the page or a script names as it stands."""
    page = (CODE / "static" / "index.html").read_text(encoding="utf-8")
    found = set(re.findall(r'data-t(?:-\w+)?="(\w+)"', page))
    for script in (CODE / "static").glob("*.js"):
        text = script.read_text(encoding="utf-8")
        found |= set(re.findall(r'\bt\("([\w.]+)"\)', text))
        found |= set(re.findall(r'toast\("(\w+)"', text))
        found |= set(re.findall(r'"(release_\w+|moved_\w+|believed_\w+)"', text))
    fleet = (CODE / "fleet.py").read_text(encoding="utf-8")
    found |= set(re.findall(r'_tell\([^)]*"(\w+)"\)', fleet))
    robot = (CODE / "robot.py").read_text(encoding="utf-8")
    return found | set(re.findall(r'tell\("error", "(\w+)"\)', robot))


def test_the_search_finds_some() -> None:
    assert {
        "estop",
        "follow",
        "text.lost",
        "take_first",
        "theme",
        "too_late",
        "reset_unconfirmed",
    } <= asked_for()


def test_every_text_that_is_asked_for_is_there() -> None:
    assert asked_for() <= set(TEXTS)


@pytest.mark.parametrize(
    ("prefix", "names"),
    [
        ("cause", [rule.name for rule in RULES]),
        ("verdict", [*get_args(Verdict), "none", "lost"]),
        ("link", [*get_args(LinkState), "none"]),
        ("fault", [*get_args(FaultName), "reserved"]),
        ("hold", list(Grip)),
        ("bumper", ["true", "false", "none"]),
    ],
)
def test_every_name_of_the_contract_has_its_text(prefix: str, names: list[str]) -> None:
    assert {f"{prefix}.{getattr(name, 'value', name)}" for name in names} <= set(TEXTS)


@pytest.mark.parametrize("direction", get_args(Direction))
def test_every_direction_has_its_texts(direction: str) -> None:
    for prefix in ("release", "release_forbidden", "believed", "moved"):
        assert f"{prefix}_{direction}" in TEXTS


def test_english_causes_are_safetys_own() -> None:
    assert {rule.name: rule.text for rule in RULES} == {
        rule.name: TEXTS[f"cause.{rule.name}"][0] for rule in RULES
    }


@pytest.mark.parametrize("key", TEXTS)
def test_both_languages_say_something(key: str) -> None:
    english, chinese = TEXTS[key]
    assert english.strip()
    assert chinese.strip()
    if key != "language":  # each names the other one
        assert not HAN.search(english)
        assert HAN.search(chinese)


def test_the_table_goes_to_the_page_by_language() -> None:
    both = table()
    assert tuple(both) == LANGUAGES
    assert (both["en"]["estop"], both["zh"]["estop"]) == TEXTS["estop"]


def test_the_door_speaks_both() -> None:
    for text in TEXTS["token_ask"]:
        assert text in asking(wrong=False)
    for text in TEXTS["token_wrong"]:
        assert text in asking(wrong=True)
