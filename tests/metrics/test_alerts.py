"""Alerts use existing metrics, and promtool accepts them."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from common.freshness import Latest
from common.messages import SafetyState
from services.metrics.samples import metric_families
from tests.metrics.robots import NOW_NS, health, safety, whole

FOLDER = Path(__file__).parent.parent.parent / "deploy" / "prometheus"
ALERTS = FOLDER / "alerts.yml"
PARTS = ("", "_bucket", "_count", "_sum", "_total")


def test_alerts_use_existing_metrics() -> None:
    robot = whole()
    robot.streams[SafetyState] = Latest(safety("estop"), NOW_NS)
    robot.on_health("bridge", health(counters={"overrun": 1}), NOW_NS)
    families = metric_families({"007": robot}, NOW_NS, connected=True, certificates={})
    exported = {family.name + part for family in families for part in PARTS}
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
