"""Every text that the page uses, in both languages; the phrases of services on the page."""

import re
from pathlib import Path
from typing import get_args

import pytest

from services.dashboard import server
from services.dashboard.driver_lock import HoldState
from services.dashboard.i18n import HAPPENED, LABELS, LATCHES, Texts, of_event, rendered, table
from t2.catalogue import EVENTS
from t2.messages import Direction, Event, FaultName, LinkState, Phrase, RoundAction, Verdict

CODE = Path(server.__file__).parent
HAN = re.compile("[\u4e00-\u9fff]")
MIXED = re.compile("[\u4e00-\u9fff] ?[,:;!?]|[，。：；？！] ")  # a mark of the other script
IN_SCRIPTS = (
    r'\bt\("([\w.]+)"[,)]', r'toast\("(\w+)"', r'"toast", "([\w.]+)"', r'"(release_\w+)"',
    r'"((?:call|next|release|reset|root)\.\w+)"', r'\btext\((?:it\.sent \? )?"([\w.]+)"',
)  # fmt: skip


def used_names() -> set[str]:
    """Return the name of every text that the page, a script or the server uses literally."""
    page = (CODE / "static" / "index.html").read_text(encoding="utf-8")
    found = set(re.findall(r'data-t(?:-\w+)?="(\w+)"', page))
    for script in (CODE / "static").glob("*.js"):
        text = script.read_text(encoding="utf-8")
        found |= {name for pattern in IN_SCRIPTS for name in re.findall(pattern, text)}
    for name in ("fleet.py", "robot_page.py", "robot.py", "i18n.py", "patrol.py"):
        code = (CODE / name).read_text(encoding="utf-8")
        found |= set(re.findall(r'\blabel\("(\w+)"', code))
    return found


def test_every_used_name_has_a_text() -> None:
    used = used_names()
    # Of the page, a script, the server, the catalogue.
    assert {"estop", "also_latched", "take_first", "next.by_hand", "event.estop_denied"} <= used
    assert used <= set(table()["en"])


@pytest.mark.parametrize(
    ("prefix", "names"),
    [
        ("verdict.", [*get_args(Verdict), "none", "lost", "no_router"]),
        ("link.", [*get_args(LinkState), "none", "missing"]),
        ("fault.", [*get_args(FaultName), "reserved"]),
        ("hold.", [*HoldState, "waiting", "slow", "still", "frozen"]),
        ("bumper.", ["true", "false", "none"]),
        ("root.", ["router", "safety", "bridge", "relay", "board", "may_move"]),
        ("release_", get_args(Direction)),
        ("believed_", get_args(Direction)),
        ("release.forbidden_", get_args(Direction)),
        ("round_", get_args(RoundAction)),
        ("left_", ["announcing", "staying", "waiting"]),
    ],
)
def test_every_name_of_the_messages_has_its_text(prefix: str, names: list[str]) -> None:
    assert {f"{prefix}{getattr(name, 'value', name)}" for name in names} <= set(table()["zh"])


def test_the_labels_have_both_languages() -> None:
    for name, (english, chinese) in LABELS.items():
        assert english.strip(), name
        assert chinese.count("{}") == english.count("{}"), name
        if name != "language":  # each names the other one
            assert not HAN.search(english), name
            assert HAN.search(chinese), name
            assert not MIXED.search(chinese), name


def test_a_text_without_known_phrases_is_shown_as_its_publisher_wrote_it() -> None:
    assert rendered((), "Ready\x1b") == Texts("Ready\\u001b", "Ready\\u001b")
    assert rendered((Phrase("newer"), Phrase("contact")), "Ready") == Texts("Ready", "Ready")


@pytest.mark.parametrize(
    ("service", "name", "phrase", "expected"),
    [
        ("bridge", "contact", "event.contact", ("The bumper is hit", "防撞条已触发")),
        (
            "safety",
            "contact",
            "contact",
            ("Reset needed: The bumper was hit.", "须复位：防撞条已触发。"),
        ),
        ("safety", "stop", "leaving", ("Stopped: The safety", "已停车：安全服务正在关闭。")),
        (
            "safety",
            "reset_refused",
            "reset.nothing",
            ("Reset refused. Nothing", "复位被拒绝。当前"),
        ),
        (
            "safety",
            "release_refused",
            "next.by_hand",
            ("Release refused. Push", "脱离操作被拒绝。请"),
        ),
    ],
)
def test_an_event_whose_text_is_a_reason_has_what_happened(
    service: str, name: str, phrase: str, expected: tuple[str, str]
) -> None:
    event = Event(name=name, level="info", text="", phrases=(Phrase(phrase),))  # type: ignore[arg-type]
    shown = of_event(service, event)
    assert shown.en.startswith(expected[0])
    assert shown.zh.startswith(expected[1])


def test_the_labels_of_events_belong_to_events_of_safety() -> None:
    names = {row.name for row in EVENTS if "safety" in row.services}
    assert {*HAPPENED, *LATCHES} <= names
