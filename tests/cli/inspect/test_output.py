"""Aligned text and JSON lines."""

import json

import pytest

from cli.inspect import output


def test_a_table_is_aligned_with_numbers_to_the_right() -> None:
    shown = output.table(("key", "Hz"), [("tel/a", "5.0"), ("b", "120.5"), ("c", "-")])
    assert shown.splitlines() == ["key       Hz", "tel/a    5.0", "b      120.5", "c          -"]


def test_control_characters_are_escaped() -> None:
    assert output.table(["a"], [["\x1b[2Jgone\n"]]) == "a\n\\u001b[2Jgone\\n"
    assert output.fields({"text": "急停\x07"}) == "text: 急停\\u0007"


def test_an_empty_table() -> None:
    assert output.table(("a", "b"), []) == "a  b"


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ({"x": 1.23456789, "ok": True, "who": None}, "x: 1.23457\nok: true\nwho: null"),
        ({"a": [1.0, 2.5], "b": []}, "a: [1, 2.5]\nb: []"),
        ({"a": {"b": {"c": 1}}, "d": {}}, "a:\n  b:\n    c: 1\nd: {}"),
        ({"a": [{"b": 1}]}, "a:\n  -\n    b: 1"),
        ("words", "words"),
        ("", '""'),
        (b"\x01\xff", "01ff"),
        (float("nan"), "nan"),
    ],
)
def test_fields(value: object, shown: str) -> None:
    assert output.fields(value) == shown


def test_any_value_is_a_json_line(capsys: pytest.CaptureFixture[str]) -> None:
    output.line({"a": float("nan"), 1: b"\x01\xff", "s": {2}, "t": (1, 2)})
    shown = json.loads(capsys.readouterr().out)
    assert shown == {"a": None, "1": "01ff", "s": "{2}", "t": [1, 2]}
