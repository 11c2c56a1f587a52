"""Normal operation of the containers: start, a lap, recording, health, logs."""

import json
import os
import re
import time

from cli.demo import host_stalls
from cli.demo.lap import PATIENT, QUICK
from cli.demo.score import good, results
from verification.containers.engine import Project, size_mb
from verification.containers.stack_fixture import BUILD_S, HEALTH_CHECKED, SERVICES, StackFixture

OURS = (*SERVICES, "router-settings")
ROUNDS = 5
COST = """
import resource, subprocess
for _ in range({rounds}):
    subprocess.run(["t2", "health", "safety"], capture_output=True, check=True)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime)
"""


def all_services_are_healthy(fixture: StackFixture) -> str:
    """Wait for all health checks."""
    fixture.wait_healthy()
    return f"healthy: {', '.join(HEALTH_CHECKED)}"


def lap_is_driven(fixture: StackFixture) -> str:
    """Drive the demo's lap over TLS."""
    slow = fixture.stall_s > host_stalls.LIMIT_S
    record = fixture.driver.drive_lap(PATIENT if slow else QUICK)
    rows = results(fixture.trace(), record, fast=False)
    seen = "; ".join(f"{what}: {value}" for what, value, fine in rows if fine is not None)
    assert good(rows), seen
    pace = f"host stalls of {fixture.stall_s:.2f} s, relaxed limits" if slow else "as shipped"
    return f"{pace}; {seen}"


def recording_is_written(fixture: StackFixture) -> str:
    """Check that the lap's contact triggered a recording."""
    listed = fixture["recorder"].python("import os; print(*os.listdir('/recordings'))").split()
    assert any(re.match(r"001-.*-latch-.*\.mcap", name) for name in listed), listed
    return listed[0]


def health_check_is_cheap(fixture: StackFixture) -> str:
    """Measure the CPU time of one health check."""
    text = COST.format(rounds=ROUNDS)
    began_s = time.monotonic()
    cost_s = float(fixture["safety"].python(text)) / ROUNDS
    took_s = (time.monotonic() - began_s) / ROUNDS
    share = len(HEALTH_CHECKED) * cost_s / 15.0
    return (
        f"{cost_s:.2f} s CPU, {took_s:.2f} s each; six services every 15 s: {share:.1%} of a core"
    )


def router_settings_are_written(fixture: StackFixture) -> str:
    """Check the configuration file for the official zenohd image."""
    text = fixture["safety"].python("print(open('/run/t2/router.json5').read())")
    made = json.loads(text)
    assert made["mode"] == "router"
    assert made["access_control"]["default_permission"] == "deny"
    return ", ".join(made["listen"]["endpoints"])


def laptop_container_connects(fixture: StackFixture) -> str:
    """Query safety from the laptop image with a driver's certificate over TLS."""
    project = laptop(fixture)
    project("build", "laptop", patience_s=BUILD_S)
    output = project("run", "--rm", "-T", "laptop", "health", "safety", "--json")
    assert json.loads(output)["told"], output
    size = size_mb(f"t2-laptop:{fixture.project.variables['T2_TAG']}")
    return f"t2-laptop, {size:.1f} MB, with driver.anna: safety answers through tls/router:7447"


def laptop(fixture: StackFixture) -> Project:
    """Return the project as a laptop runs it; its keys belong to the current user."""
    project = fixture.project
    own = {
        "T2_KEYS": str(project.files[-1].parent / "keys" / "driver.anna"),
        "T2_ROUTER": "tls/router:7447",
        "T2_USER": f"{os.getuid()}:{os.getgid()}",
    }
    return Project(project.name, project.files, {**project.variables, **own}, ["laptop"])


def logs_are_valid(fixture: StackFixture) -> str:
    """Check that all log lines are JSON without tracebacks."""
    count = 0
    for name in OURS:
        text = fixture[name].log()
        assert "Traceback" not in text, f"{name}: {text[text.index('Traceback') :][:1500]}"
        for line in filter(None, text.splitlines()):
            assert isinstance(parsed(name, line), dict), (name, line)
            count += 1
    return f"{count} lines of JSON in {len(OURS)} logs, no traceback; rotated at 10 MB"


def parsed(name: str, line: str) -> object:
    """Parse a log line."""
    try:
        return json.loads(line)
    except ValueError:
        raise AssertionError(f"{name}: not JSON: {line}") from None
