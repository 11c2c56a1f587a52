"""The catalogue is complete in both languages, and its phrases are rendered."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from cli.inspect import findings
from services.safety.core.causes import RULES
from services.teleop import labels
from t2.catalogue import CAUSES, EVENTS, TEXTS, WORDS
from t2.messages import Field, Phrase
from t2.words import PLACEHOLDER, render
from tools.docs import ROOT

CHINESE = re.compile("[\u4e00-\u9fff]")


def phrases() -> Iterator[tuple[Path, str]]:
    """Yield the phrases that the stack makes with a literal name."""
    for folder in ("common", "services", "cli", "sdk/t2"):
        for file in (ROOT / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text("utf-8"))):
                if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Phrase":
                    name = node.args[0]
                    if isinstance(name, ast.Constant):
                        yield file, str(name.value)


def test_every_text_is_complete_in_both_languages() -> None:
    for name, (english, chinese) in TEXTS.items():
        assert english, name
        assert name in ("operator.by", "gamepad.device", "log.text") or CHINESE.search(chinese), (
            name
        )
        fields = [sorted(set(PLACEHOLDER.findall(text))) for text in (english, chinese)]
        assert fields[0] == fields[1], name
    for name, words in WORDS.items():
        assert all(words), name


def test_every_cause_and_event_has_a_remedy() -> None:
    assert set(CAUSES) == {rule.name for rule in RULES}
    for name, entry in CAUSES.items():
        assert all((*entry.text, *entry.remedy)), name
    for row in EVENTS:
        assert all((*row.text, *row.remedy)), row.name


def test_every_phrase_of_the_stack_is_in_a_catalogue() -> None:
    known = labels.TEXTS.keys() | findings.TEXTS.keys()  # of a screen of its own, too
    unknown = {(file.name, name) for file, name in phrases() if name not in known}
    assert not unknown


def test_a_phrase_has_its_figures_and_words() -> None:
    near = Phrase("blocked.near", {"sonar": "front_left", "distance": 0.4567})
    assert render((near,)) == "No room toward the front left: 0.46 m."
    assert render((near, Phrase("next.reset")), "zh") == "左前方空间不足：0.46 m。复位后方可行驶。"
    faults = Phrase("driver.faults", {"side": "left", "faults": ("over_current", "bit_7")})
    assert render((faults,)) == "The left motor driver reports: over current, bit 7."
    assert render((faults,), "zh") == "左侧电机驱动器报告：过流、bit 7。"


def test_a_service_is_named_for_people_and_for_commands() -> None:
    hangs = Phrase("doctor.services.absent", {"names": ("bridge", "odom", "mine")})
    assert render((hangs,), "en", texts=findings.TEXTS) == "bridge, odom, mine are not running"
    expected = "桥接服务（bridge）、里程计（odom）、mine未运行"
    assert render((hangs,), "zh", texts=findings.TEXTS) == expected


@pytest.mark.parametrize("phrases", [(), (Phrase("of_2030"),), (Phrase("next.reset"), Phrase("x"))])
def test_a_phrase_of_a_later_version_is_shown_by_the_text(phrases: tuple[Phrase, ...]) -> None:
    assert render(phrases, "zh", "The bumper is frozen.") == "The bumper is frozen."


@pytest.mark.parametrize("value", ["x", None, True, 3, 2.5, ("a", "b")])
def test_a_field_of_another_type_is_shown_as_it_is(value: Field) -> None:
    text = render((Phrase("call.late", {"age": value}),))
    assert text.startswith("The call is ")
