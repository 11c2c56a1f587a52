"""What a guard reads has no word of our trade, in either language.

The guard's screens are the page and the terminal of ``t2 drive``. Tools for technicians show the
same texts, with the names of causes beside them.
"""

import re
from collections.abc import Iterator

import pytest

from services.dashboard import i18n
from services.teleop import labels
from t2.catalogue import TEXTS, WORDS
from t2.patrol_texts import Words
from t2.words import PLACEHOLDER

JARGON = re.compile(
    r"\b(?:sources?|request\w*|neutral|routers?|inhibit\w*|latch\w*|heartbeats?|leases?)\b"
    # 电源 is a power supply, 来源 an origin.
    "|(?<![电来])源|请求|中性|路由器|抑制|心跳|租约|租期|保活|锁定",
    re.IGNORECASE,
)
# Commands and settings have their names: `t2 call`, ros2.neutral.
NAMES = re.compile(r"`[^`]*`|\b\w+\.\w+\b")
ALLOWED = {
    "call.no_echo": "an answer to a program: it names the fields to send, as our screens do",
    "router_at": "below *For the technician*, which is folded",
}


def jargon(text: str) -> list[str]:
    """Return the words of our trade in a template."""
    return JARGON.findall(NAMES.sub("", PLACEHOLDER.sub("", text)))


def shown() -> Iterator[tuple[str, Words]]:
    """Yield the texts of the guard's screens, by name."""
    yield from TEXTS.items()
    yield from WORDS.items()
    yield from labels.LABELS.items()
    yield from i18n.LABELS.items()


def test_no_text_of_a_guard_has_a_word_of_our_trade() -> None:
    found = {name: jargon("\n".join(words)) for name, words in shown()}
    assert {name for name, words in found.items() if words} == ALLOWED.keys(), found


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Two publishers use one source.", ["source"]),
        ("NO ROUTER: a Neutral request is due, it has latched.",
         ["ROUTER", "Neutral", "request", "latched"]),
        ("已锁定：没有请求源处于控制中，未连接路由器。", ["锁定", "请求", "源", "路由器"]),
        ("{source} drives: see `t2 router`, safety.sources.", []),
        ("请检查电源和定位修正的来源。", []),
    ],
)  # fmt: skip
def test_the_words_are_found(text: str, expected: list[str]) -> None:
    assert jargon(text) == expected
