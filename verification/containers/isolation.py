"""Images and isolation: size, tools, rights, limits and networks."""

import json
import urllib.error
import urllib.request

from verification.containers.engine import size_mb
from verification.containers.stack_fixture import SERVICES, StackFixture

ROBOT_MB = 120.0
NO_NETWORK = ("safety", "odom", "recorder")
HOST_NETWORK = ("bridge", "sim")
STATUS = """
import json
lines = dict(l.split(":", 1) for l in open("/proc/self/status") if ":" in l)
print(json.dumps({n: lines[n].strip() for n in ("Uid", "CapEff", "CapBnd", "NoNewPrivs")}))
"""
WRITES = """
import pathlib, tempfile
for place in ("/opt/t2", "/etc/t2", "/opt/venv/bin/python", "/run/x"):
    try:
        pathlib.Path(place + ".new").write_bytes(b"")
    except OSError as error:
        print(error.errno)
    else:
        print(place, "was written")
pathlib.Path(tempfile.gettempdir(), "x").write_bytes(b"")
"""
LINKS = "import os; print(*sorted(os.listdir('/sys/class/net')))"


def image_is_small(fixture: StackFixture) -> str:
    """Check the size of the robot's image."""
    sizes = {name: size_mb(fixture[name].about["Image"]) for name in ("safety", "dashboard")}
    assert sizes["safety"] < ROBOT_MB, sizes
    return f"robot {sizes['safety']:.1f} MB, with the dashboard {sizes['dashboard']:.1f} MB"


def image_has_no_tools(fixture: StackFixture) -> str:
    """Check that there is no shell and no installer."""
    found = fixture["safety"].python(
        "import shutil; print([n for n in ('sh', 'bash', 'busybox', 'apt', 'dpkg', 'pip', 'pip3',"
        " 'perl') if shutil.which(n, path='/bin:/usr/bin:/usr/local/bin:/sbin:/opt/venv/bin')])"
    )
    assert found == "[]", found
    return "no sh, apt, dpkg, pip, perl"


def rights_are_minimal(fixture: StackFixture) -> str:
    """Check user, capabilities and privileges of the processes."""
    for name in SERVICES:
        state = json.loads(fixture[name].python(STATUS))
        assert set(state["Uid"].split()) == {"10001"}, (name, state)
        assert int(state["CapEff"], 16) == int(state["CapBnd"], 16) == 0, (name, state)
        assert state["NoNewPrivs"] == "1", (name, state)
    return f"uid 10001, no capability, no new privileges, in {len(SERVICES)} containers"


def root_is_read_only(fixture: StackFixture) -> str:
    """Check that only /tmp, the socket's folder and the recordings are writable."""
    for name in SERVICES:
        refused = fixture[name].python(WRITES).split()
        assert refused == ["30"] * 4, (name, refused)  # EROFS
    return "EROFS everywhere but in /tmp"


def resources_are_limited(fixture: StackFixture) -> str:
    """Check limits, log rotation, init and restart policy."""
    for name in SERVICES:
        host = fixture[name].about["HostConfig"]
        limits = {key: host[key] for key in ("Memory", "MemorySwap", "NanoCpus", "PidsLimit")}
        assert all(limit and limit > 0 for limit in limits.values()), (name, limits)
        assert limits["Memory"] == limits["MemorySwap"], (name, limits)
        assert host["LogConfig"]["Config"].keys() >= {"max-size", "max-file"}, (name, host)
        assert host["Init"], name
        assert host["RestartPolicy"]["Name"] == "unless-stopped", name
    return "memory, CPUs, processes, log files; an init; restart unless stopped"


def networks_are_minimal(fixture: StackFixture) -> str:
    """Check the networks of each container."""
    for name in NO_NETWORK:
        assert fixture[name].python(LINKS) == "lo", name
    hosts = [
        name for name in SERVICES if fixture[name].about["HostConfig"]["NetworkMode"] == "host"
    ]
    assert sorted(hosts) == sorted(HOST_NETWORK), hosts
    return f"none: {', '.join(NO_NETWORK)}; the host's: {', '.join(HOST_NETWORK)}"


def dashboard_requires_its_token(fixture: StackFixture) -> str:
    """Check that the dashboard is on loopback only, and requires the token from the log."""
    bindings = fixture["dashboard"].about["HostConfig"]["PortBindings"]["8080/tcp"]
    assert [binding["HostIp"] for binding in bindings] == ["127.0.0.1"], bindings
    page = f"http://127.0.0.1:{fixture.ports.page}/"
    token = fixture["dashboard"].log().rsplit("?token=", 1)[1].split('"')[0]
    browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    seen = [status(browser, page), status(browser, f"{page}?token={token}")]
    assert seen == [401, 200], seen
    return "401 without, 200 with it"


def status(browser: urllib.request.OpenerDirector, address: str) -> int:
    """Return the HTTP status."""
    try:
        with browser.open(address, timeout=10) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code
