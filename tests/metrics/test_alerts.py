"""Alerts use existing metrics, and promtool accepts them."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from services.metrics.samples import metric_families
from tests.factories import health
from tests.metrics.robots import NOW_NS, PATROL, SAFETY, patrol, safety, whole

FOLDER = Path(__file__).parent.parent.parent / "deploy" / "prometheus"
ALERTS = FOLDER / "alerts.yml"
PARTS = ("", "_total")


def test_alerts_use_existing_metrics() -> None:
    robot = whole()
    robot.on_message(SAFETY, safety("estop"), NOW_NS)
    robot.on_message(PATROL, patrol("stopped"), NOW_NS)
    robot.on_message("tel/bridge/health", health(counters={"overrun": 1}), NOW_NS)
    families = metric_families({"007": robot}, NOW_NS, connected=True)
    exported = {family.name + part for family in families for part in PARTS}
    used = set(re.findall(r"\bt2_\w+", ALERTS.read_text(encoding="utf-8")))
    assert len(used) > 8
    assert used <= exported


def test_promtool_accepts_configuration_and_the_tests_of_the_alerts() -> None:
    promtool = shutil.which("promtool")
    if promtool is None:
        pytest.skip("promtool is not installed (Debian's package prometheus has it)")
    for words in (("check", "config", "prometheus.yml"), ("test", "rules", "alerts_test.yml")):
        command = [promtool, *words[:2], str(FOLDER / words[2])]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
