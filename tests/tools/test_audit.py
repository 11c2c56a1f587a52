"""``make audit`` reports unchecked packages."""

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
        ([GOOD, ABSENT, BAD], audit.VULNERABLE),
    ],
)
def test_the_verdict(packages: list[dict[str, Any]], code: int) -> None:
    assert audit.verdict(packages) == code


def test_each_vulnerability_has_its_fix() -> None:
    lines = list(audit.report([GOOD, BAD, ABSENT]))
    assert lines[0] == "jinja2 1.0: PYSEC-1, fixed in 1.1, 2.0"
    assert lines[1] == "jinja2 1.0: X, fixed in no version yet"
    assert lines[2].startswith("NOT CHECKED: 1 of 3")
    assert lines[3].endswith("zenoh")
    assert lines[4].startswith("2 of 3 packages checked")


def fake_tool(tmp_path: Path, code: str) -> list[str]:
    """Return a command that runs this code with ``out``, the result file."""
    script = tmp_path / "tool.py"
    script.write_text(f"import sys\nout = sys.argv[4]\n{code}", encoding="utf-8")
    return [sys.executable, str(script)]


@pytest.fixture(autouse=True)
def _result_in_tmp(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(audit, "RESULT", tmp_path / "out" / "audit.json")


def test_a_failed_run_is_no_success(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "audit.json").write_text("an old result", encoding="utf-8")
    tool = fake_tool(tmp_path, "sys.exit('a story\\nName or service not known')")
    assert audit.main(["x.lock"], tool) == audit.UNKNOWN
    output = capsys.readouterr().out
    assert output == "NOT CHECKED: pip-audit failed: Name or service not known\n"
    assert audit.main(["x.lock"], fake_tool(tmp_path, "sys.exit(3)")) == audit.UNKNOWN
    assert "exit code 3" in capsys.readouterr().out


def test_the_summary(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answer = json.dumps({"dependencies": [GOOD]})
    tool = fake_tool(tmp_path, f"open(out, 'w').write({answer!r})")
    assert audit.main(["x.lock"], tool) == audit.CLEAN
    assert "1 of 1 packages checked" in capsys.readouterr().out
