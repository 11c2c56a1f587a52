"""What the containers do when nothing fails: they come up, drive a lap, tell and record."""

import json
import os
import re
import time

from cli.demo import host_stalls
from cli.demo.score import good, results
from cli.demo.script import PATIENT, QUICK
from verification.containers.engine import Project, size_mb
from verification.containers.stack_fixture import ASKED, BUILD_S, SERVICES, Stage

OURS = (*SERVICES, "router-settings")
ROUNDS = 5
COST = """
import resource, subprocess
for _ in range({rounds}):
    subprocess.run(["t2", "health", "safety"], capture_output=True, check=True)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime)
"""


def all_fare_well(stage: Stage) -> str:
    """Every service says so itself, over the bus."""
    stage.wait_well()
    return f"healthy: {', '.join(ASKED)}"


def lap_is_driven(stage: Stage) -> str:
    """The demo's lap, by a driver who comes in over TLS."""
    slow = stage.holdup_s > host_stalls.LIMIT_S
    odometry = stage.wheel.drive_lap(PATIENT if slow else QUICK)
    rows = results(stage.trace(), odometry, stage.wheel.driver.lap, fast=False)
    seen = "; ".join(f"{what}: {value}" for what, value, fine in rows if fine is not None)
    assert good(rows), seen
    pace = f"machine holds up for {stage.holdup_s:.2f} s, longer limits" if slow else "as shipped"
    return f"{pace}; {seen}"


def black_box_is_written(stage: Stage) -> str:
    """The lap's contact has latched."""
    listed = stage["recorder"].python("import os; print(*os.listdir('/recordings'))").split()
    assert any(re.match(r"001-.*-latch-.*\.mcap", name) for name in listed), listed
    return listed[0]


def health_is_cheap(stage: Stage) -> str:
    """What one check costs, by the CPU time that its own process tells."""
    text = COST.format(rounds=ROUNDS)
    began_s = time.monotonic()
    cost_s = float(stage["safety"].python(text)) / ROUNDS
    took_s = (time.monotonic() - began_s) / ROUNDS
    share = len(ASKED) * cost_s / 15.0
    return (
        f"{cost_s:.2f} s CPU, {took_s:.2f} s each; six services every 15 s: {share:.1%} of a core"
    )


def settings_of_the_router_are_made(stage: Stage) -> str:
    """The official image would start from this file."""
    text = stage["safety"].python("print(open('/run/t2/router.json5').read())")
    made = json.loads(text)
    assert made["mode"] == "router"
    assert made["access_control"]["default_permission"] == "deny"
    return ", ".join(made["listen"]["endpoints"])


def laptop_comes_in(stage: Stage) -> str:
    """The laptop's own image, with a driver's certificate, asks over TLS."""
    project = laptop(stage)
    project("build", "laptop", patience_s=BUILD_S)
    said = project("run", "--rm", "-T", "laptop", "health", "safety", "--json")
    assert json.loads(said)["told"], said
    size = size_mb(f"t2-laptop:{stage.project.variables['T2_TAG']}")
    return f"t2-laptop, {size:.1f} MB, with driver.anna: safety answers through tls/router:7447"


def laptop(stage: Stage) -> Project:
    """Return the same project as a laptop runs it; its keys belong to who runs this."""
    project = stage.project
    own = {
        "T2_KEYS": str(project.files[-1].parent / "keys" / "driver.anna"),
        "T2_ROUTER": "tls/router:7447",
        "T2_USER": f"{os.getuid()}:{os.getgid()}",
    }
    return Project(project.name, project.files, {**project.variables, **own}, ["laptop"])


def logs_are_in_order(stage: Stage) -> str:
    """JSON, a line for each; no traceback, though much was killed; the files are limited."""
    count = 0
    for name in OURS:
        text = stage[name].log()
        assert "Traceback" not in text, f"{name}: {text[text.index('Traceback') :][:1500]}"
        for line in filter(None, text.splitlines()):
            assert isinstance(parsed(name, line), dict), (name, line)
            count += 1
    return f"{count} lines of JSON in {len(OURS)} logs, no traceback; rotated at 10 MB"


def parsed(name: str, line: str) -> object:
    """Return a line of a log as JSON."""
    try:
        return json.loads(line)
    except ValueError:
        raise AssertionError(f"{name} said what is no JSON: {line}") from None
