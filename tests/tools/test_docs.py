"""The generated documents, and the tests that the safety case names."""

import re
from pathlib import Path

import pytest

from tools import docs

NAMED = re.compile(r"`(tests/[\w/]+\.py)(?:::(\w+))?`")


def test_every_test_in_the_safety_case_exists() -> None:
    named = NAMED.findall((docs.DOCS / "safety.md").read_text(encoding="utf-8"))
    assert len(named) > 15
    for file, name in named:
        text = (docs.ROOT / file).read_text(encoding="utf-8")
        assert f"def {name}" in text or f"\n{name} = " in text, f"{file}::{name}"


def test_a_stale_page_fails_the_check(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "bus.md"
    page.write_text("new", encoding="utf-8")
    monkeypatch.setattr(docs, "ROOT", tmp_path)
    monkeypatch.setattr(docs, "generated", lambda: {page: "new"})
    assert docs.main(["--check"]) == 0
    monkeypatch.setattr(docs, "generated", lambda: {page: "newer"})
    assert docs.main(["--check"]) == 1
    assert capsys.readouterr().out == "bus.md is not current; run `make docs`\n"
    assert docs.main([]) == 0
    assert page.read_text(encoding="utf-8") == "newer"
