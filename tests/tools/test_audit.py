"""``make audit`` never calls clean what it could not check."""

import json
import sys
from pathlib import Path
from typing import Any

import pytest

from tools import audit

GOOD = {"name": "msgpack", "version": "1.2.4", "vulns": []}
BAD = {
    "name": "jinja2",
    "version": "1.0",
    "vulns": [{"id": "PYSEC-1", "fix_versions": ["1.1", "2.0"]}, {"id": "X", "fix_versions": []}],
}
ABSENT = {"name": "zenoh", "skip_reason": "Dependency not found"}


@pytest.mark.parametrize(
    ("packages", "code"),
    [
        ([GOOD], audit.CLEAN),
        ([GOOD, ABSENT], audit.UNKNOWN),
        ([ABSENT], audit.UNKNOWN),
        ([], audit.UNKNOWN),
        ([GOOD, ABSENT, BAD], audit.FLAWED),
    ],
)
def test_the_verdict(packages: list[dict[str, Any]], code: int) -> None:
    assert audit.verdict(packages) == code


def test_each_flaw_is_told_with_its_cure() -> None:
    told = list(audit.told([GOOD, BAD, ABSENT]))
    assert told[0] == "jinja2 1.0: PYSEC-1, fixed in 1.1, 2.0"
    assert told[1] == "jinja2 1.0: X, fixed in no version yet"
    assert told[2].startswith("NOT CHECKED: 1 of 3")
    assert told[3].endswith("zenoh")
    assert told[4].startswith("2 of 3 packages checked")


def pretending(tmp_path: Path, code: str) -> list[str]:
    """Return a tool that does this with the name of the file that is wanted."""
    script = tmp_path / "tool.py"
    script.write_text(f"import sys\nout = sys.argv[4]\n{code}", encoding="utf-8")
    return [sys.executable, str(script)]


@pytest.fixture(autouse=True)
def _answer_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(audit, "ANSWER", tmp_path / "out" / "audit.json")


def test_no_answer_is_no_success(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "audit.json").write_text("of yesterday", encoding="utf-8")
    tool = pretending(tmp_path, "sys.exit('a story\\nName or service not known')")
    assert audit.main(["x.lock"], tool) == audit.UNKNOWN
    said = capsys.readouterr().out
    assert said == "NOT CHECKED: pip-audit did not get an answer: Name or service not known\n"
    assert audit.main(["x.lock"], pretending(tmp_path, "sys.exit(3)")) == audit.UNKNOWN
    assert "it ended with 3" in capsys.readouterr().out


def test_an_answer_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answer = json.dumps({"dependencies": [GOOD]})
    tool = pretending(tmp_path, f"open(out, 'w').write({answer!r})")
    assert audit.main(["x.lock"], tool) == audit.CLEAN
    assert "1 of 1 packages checked" in capsys.readouterr().out
