"""The alerts ask for metrics that are there, and Prometheus takes them."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from services.metrics.samples import FAMILIES

FOLDER = Path(__file__).parent.parent.parent / "deploy" / "prometheus"
ALERTS = FOLDER / "alerts.yml"
PARTS = ("", "_bucket", "_count", "_sum")


def test_every_metric_that_an_alert_asks_for_is_told() -> None:
    told = {family.name + part for family in FAMILIES for part in PARTS}
    asked = set(re.findall(r"\bt2_\w+", ALERTS.read_text(encoding="utf-8")))
    assert len(asked) > 8
    assert asked <= told


@pytest.fixture
def promtool() -> str:
    found = shutil.which("promtool")
    if found is None:
        pytest.skip("promtool is not installed (Debian's package prometheus has it)")
    return found


def test_prometheus_takes_the_configuration_and_the_alerts(promtool: str) -> None:
    said = checked(promtool, "check", "config", str(FOLDER / "prometheus.yml"))
    assert "SUCCESS" in said


def test_the_alerts_say_what_they_should(promtool: str) -> None:
    assert "SUCCESS" in checked(promtool, "test", "rules", str(FOLDER / "alerts_test.yml"))


def checked(*command: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
