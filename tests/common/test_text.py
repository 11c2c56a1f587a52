"""Texts with escape sequences."""

import json

from common.text import printable


def test_control_and_formatting_characters_are_escaped() -> None:
    hostile = "\x1b]0;title\x07\x1b[2J\x9b31m\u202egnp.exe\u2066\x7f\r\n"
    shown = printable(hostile)
    assert shown.isprintable()
    assert shown.startswith("\\u001b]0;title\\u0007\\u001b[2J\\u009b31m\\u202egnp.exe")
    assert printable(hostile, "\n") == shown.removesuffix("\\n") + "\n"
    assert printable("急停 é 🤖") == "急停 é 🤖"


def test_json_remains_valid() -> None:
    value = {"text\x9b": "\x1b[2J\u202e\U000e0001急停"}
    shown = printable(json.dumps(value, ensure_ascii=False))
    assert shown.isprintable()
    assert json.loads(shown) == value
