"""Alerts use existing metrics, and promtool accepts them."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from services.metrics.samples import FAMILIES

FOLDER = Path(__file__).parent.parent.parent / "deploy" / "prometheus"
ALERTS = FOLDER / "alerts.yml"
PARTS = ("", "_bucket", "_count", "_sum")


def test_alerts_use_existing_metrics() -> None:
    exported = {family.name + part for family in FAMILIES for part in PARTS}
    used = set(re.findall(r"\bt2_\w+", ALERTS.read_text(encoding="utf-8")))
    assert len(used) > 8
    assert used <= exported


@pytest.fixture
def promtool() -> str:
    found = shutil.which("promtool")
    if found is None:
        pytest.skip("promtool is not installed (Debian's package prometheus has it)")
    return found


def test_promtool_accepts_configuration_and_alerts(promtool: str) -> None:
    message = checked(promtool, "check", "config", str(FOLDER / "prometheus.yml"))
    assert "SUCCESS" in message


def test_promtool_rule_tests_pass(promtool: str) -> None:
    assert "SUCCESS" in checked(promtool, "test", "rules", str(FOLDER / "alerts_test.yml"))


def checked(*command: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
