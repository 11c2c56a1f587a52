"""What is looked at, in this order; each returns what it saw, or fails."""

import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from verification.harness.support import wait_until
from verification.soak import driver
from verification.systemd.machine import Machine

PATIENCE_S = 60.0
CORE = ("router", "safety", "bridge", "odom", "recorder")
UNITS = [f"t2-{name}.service" for name in CORE]
INSTALL = ("sh", "/wheelhouse/t2-install.sh")
SETTINGS = "/etc/t2/t2.toml"
T2 = "/opt/t2/current/bin/t2"
DRIVER = "/opt/drive_laps.py"  # carried there: it does not ship
TRACE = """[Service]
StateDirectory=t2
ExecStart=
ExecStart=/opt/t2/current/bin/python -P -m sim --config /etc/t2/t2.toml --trace /var/lib/t2/trace
"""
TAKER = """
import socket, time
sock = socket.socket(type=socket.SOCK_DGRAM)
sock.bind(("127.0.0.1", 4002))
time.sleep(900)
"""
REBUILD = (
    "echo '# next' >> requirements.txt; rm SHA256SUMS; sha256sum -- * > ../sums; "
    "mv ../sums SHA256SUMS"
)


def installs(m: Machine) -> str:
    """Install from the wheelhouse; there is no network."""
    started_s = time.monotonic()
    m.said(*INSTALL, "--sim")
    took_s = time.monotonic() - started_s
    again = m.said(*INSTALL)
    assert "exists already" in again, again
    assert "keep    /etc/t2/t2.toml" in again, again
    m.write(SETTINGS, m.said("cat", SETTINGS) + "\n[sim]\ncontrol_port = 4009\n")
    m.write("/etc/systemd/system/t2-sim.service.d/trace.conf", TRACE)
    m.said("systemd-sysusers")
    m.said("systemctl", "daemon-reload")
    size = m.said("sh", "-c", "du -smL /opt/t2/current | cut -f 1").strip()
    return f"in {took_s:.0f} s, {size} MB; the second time it changes nothing"


def verifies(m: Machine) -> str:
    """Have systemd judge the units."""
    said = m.said("systemd-analyze", "verify", "t2.target", *UNITS)
    assert not said.strip(), said
    marks = {}
    for name in UNITS:
        line = m.said("systemd-analyze", "security", name).strip().splitlines()[-1]
        found = re.search(r": ([\d.]+) (\w+)", line)
        assert found, line
        marks[name.removeprefix("t2-").removesuffix(".service")] = float(found[1])
    assert max(marks.values()) < 3, marks
    return "no complaint; exposure " + ", ".join(f"{name} {mark}" for name, mark in marks.items())


def starts(m: Machine) -> str:
    """Start it as an operator does; READY comes in order."""
    started_s = time.monotonic()
    m.said("systemctl", "enable", "--now", "t2.target")
    took_s = time.monotonic() - started_s
    wait_until(lambda: all(active(m, name) for name in UNITS), "all active", PATIENCE_S)
    order = [int(m.unit(name)["ActiveEnterTimestampMonotonic"]) for name in UNITS[:3]]
    assert order == sorted(order), dict(zip(UNITS, order, strict=False))
    assert all(m.unit(name)["NRestarts"] == "0" for name in UNITS)
    return f"{len(UNITS)} active by notify in {took_s:.1f} s: router, safety, bridge"


def shuts_out(m: Machine) -> str:
    """Let nobody onto the bus who is not in the group."""
    seen = m.said("stat", "-c", "%A %U %G", "/run/t2", "/run/t2/bus.sock").split("\n")
    code = "import socket; socket.socket(socket.AF_UNIX).connect('/run/t2/bus.sock')"
    python = "/opt/t2/current/bin/python"
    refused = m.tried(
        "setpriv", "--reuid=nobody", "--regid=nogroup", "--clear-groups", python, "-c", code
    )
    assert "PermissionError" in refused.stdout, refused.stdout
    m.said("setpriv", "--reuid=nobody", "--regid=nogroup", "--groups=t2", python, "-c", code)
    said = m.python("-m", "cli", "health", "--config", SETTINGS)
    assert "hangs" not in said, said
    return f"{seen[0]}, {seen[1]}: the group comes in, others do not; `t2 health` is content"


def keeps_apart(m: Machine) -> str:
    """Check that only bridge and safety can connect to the drive link."""
    socket = "/run/t2-drive/drive.sock"
    seen = m.said("stat", "-c", "%A %U %G", "/run/t2-drive", socket).split("\n")
    assert seen[:2] == ["drwx------ t2 t2", "srw------- t2 t2"], seen
    for name in UNITS:
        enter = ("nsenter", "-m", "-t", m.unit(name)["MainPID"])
        inside = m.tried(*enter, "stat", socket).returncode == 0
        assert inside == (name in ("t2-bridge.service", "t2-safety.service")), name
    return "bridge and safety see their socket, the others do not, and it is the user's alone"


def watched(m: Machine) -> str:
    """Stop each process as a debugger would: systemd kills it and starts it again."""
    took = []
    for name in UNITS[:4]:
        drives(m)
        before = m.unit(name)
        started_s = time.monotonic()
        signal_main(m, name, "STOP")
        wait_until(lambda n=name, b=before: renewed(m, n, b), f"a new {name}", PATIENCE_S)  # type: ignore[misc]
        took.append(f"{name[3:-8]} {time.monotonic() - started_s:.1f} s")
        assert "watchdog" in m.said("journalctl", "-u", name, "-o", "cat").lower()
        rests(m) if name == "t2-bridge.service" else None
    return "hang to READY: " + ", ".join(took)


def killed(m: Machine) -> str:
    """Kill each process; it comes back, and the vehicle drives on once it may."""
    took = []
    for name in UNITS:
        before = m.unit(name)
        started_s = time.monotonic()
        signal_main(m, name, "KILL")
        wait_until(lambda n=name, b=before: renewed(m, n, b), f"a new {name}", PATIENCE_S)  # type: ignore[misc]
        took.append(f"{name[3:-8]} {time.monotonic() - started_s:.1f} s")
    drives(m)
    return "kill to READY: " + ", ".join(took) + "; it drives"


def stops_in_order(m: Machine) -> str:
    """Stop it all while it drives: the bridge first, and the vehicle stands."""
    speed = drives(m)
    m.said("systemctl", "stop", "t2.target", "t2-sim.service", *UNITS)
    ends = {
        n: int(m.unit(n)["InactiveEnterTimestampMonotonic"]) for n in [*UNITS, "t2-sim.service"]
    }
    bridge = ends["t2-bridge.service"]
    behind = ("t2-safety.service", "t2-router.service", "t2-sim.service")
    assert all(ends[name] >= bridge for name in behind), ends
    assert ends["t2-router.service"] >= ends["t2-safety.service"], ends
    lines = [
        json.loads(line) for line in m.said("tail", "-n", "400", "/var/lib/t2/trace").splitlines()
    ]
    last = [line for line in lines if line["event"] == "command"][-1]
    truth = [line for line in lines if line["event"] == "truth"][-1]
    # BREAK, where the machine holds processes up and the vehicle was not seen to stand.
    assert last["kind"] in ("stop", "brake"), last
    results = {m.unit(name)["Result"] for name in UNITS}
    assert results == {"success"}, results
    held = f"{last['kind'].upper()} is the last command, at {truth['linear']:.2f} m/s it ends"
    return f"from {speed:.2f} m/s: {held}; first the bridge, then safety, then the router"


def lets_in(m: Machine) -> str:
    """Give the robot its keys: a viewer comes in over TLS, and nobody without a certificate."""
    with tempfile.TemporaryDirectory() as folder:
        for words in ("init", "issue robot 001", "issue viewer anna"):
            command = [sys.executable, "-m", "cli", "keys", *words.split(), "--folder"]
            subprocess.run([*command, f"{folder}/keys"], check=True, stdout=subprocess.DEVNULL)
        m.carry(Path(folder) / "keys" / "robot.001", "/etc/t2/keys")
        m.carry(Path(folder) / "keys" / "viewer.anna", "/root/anna")
    m.said("chown", "-R", "t2:", "/etc/t2/keys")
    m.said(T2, "install")
    m.said("systemctl", "daemon-reload")
    m.said("systemctl", "start", "t2.target")
    wait_until(lambda: all(active(m, name) for name in UNITS), "all active", PATIENCE_S)
    here = ("--set", "bus.connect=tls/127.0.0.1:7447")
    see = (T2, "health", "--config", "/root/anna/bus.toml", *here)
    wait_until(lambda: m.tried(*see).returncode == 0, "a viewer who sees them all", PATIENCE_S)
    refused = m.tried(T2, "health", "--set", "bus.ca=/root/anna/ca.pem", *here)
    assert refused.returncode != 0, refused.stdout
    return "with /etc/t2/keys: a viewer sees all services over TLS, a stranger sees none"


def refuses(m: Machine) -> str:
    """End for good with a wrong setting, and try again with a port that is taken."""
    good = m.said("cat", SETTINGS)
    m.write(SETTINGS, good + "\n[odom]\nhold = 99.0\n")
    m.tried("systemctl", "restart", "t2-odom.service")
    wait_until(
        lambda: m.unit("t2-odom.service")["ActiveState"] == "failed", "its failure", PATIENCE_S
    )
    unit = m.unit("t2-odom.service")
    assert (unit["ExecMainStatus"], unit["Result"]) == ("78", "exit-code"), unit
    said = m.said("journalctl", "-u", "t2-odom.service", "-o", "cat", "-n", "20")
    assert "odom.hold = 99.0" in said, said
    m.write(SETTINGS, good)
    m.said("systemctl", "stop", "t2-bridge.service")
    m.said("systemd-run", "--unit=taker", "/opt/t2/current/bin/python", "-c", TAKER)
    m.said("systemctl", "start", "--no-block", "t2.target")
    wait_until(lambda: int(m.unit("t2-bridge.service")["NRestarts"]) >= 1, "a retry", PATIENCE_S)
    m.said("systemctl", "stop", "taker.service")
    wait_until(lambda: active(m, "t2-bridge.service"), "the bridge", PATIENCE_S)
    return "a wrong setting: 78, failed, named in the journal; a taken port: tried until it is free"


def upgrades(m: Machine) -> str:
    """Install another build beside it, go back, and take everything away again."""
    m.said("cp", "-r", "/wheelhouse", "/srv/next")
    m.said("sh", "-c", f"cd /srv/next; {REBUILD}")
    first = m.said("readlink", "/opt/t2/current")
    m.said("sh", "/srv/next/t2-install.sh")
    assert m.said("readlink", "/opt/t2/current") != first
    m.said("systemctl", "restart", "t2.target")
    wait_until(lambda: all(active(m, name) for name in UNITS), "the next version", PATIENCE_S)
    m.said(*INSTALL, "--rollback")
    assert m.said("readlink", "/opt/t2/current") == first
    m.said("systemctl", "restart", "t2.target")
    wait_until(lambda: all(active(m, name) for name in UNITS), "the version before", PATIENCE_S)
    assert "replace" not in m.said(T2, "install"), "its own prefix is the link"
    assert "disable --now" in m.tried(T2, "install", "--uninstall").stdout
    m.said("systemctl", "disable", "--now", "t2.target")
    m.said(T2, "install", "--uninstall")
    assert m.tried("systemctl", "cat", "t2-odom.service").returncode != 0
    m.said("test", "-f", SETTINGS)
    return "to another build and back; uninstalled, the settings stay"


CHECKS: list[Callable[[Machine], str]] = [
    installs, verifies, starts, shuts_out, keeps_apart, watched, killed, stops_in_order, lets_in,
    refuses, upgrades,
]  # fmt: skip


# --- what they look with ------------------------------------------------------------------------


def active(m: Machine, name: str) -> bool:
    """Tell whether a unit has said that it is ready."""
    return m.unit(name)["ActiveState"] == "active"


def renewed(m: Machine, name: str, before: dict[str, str]) -> bool:
    """Tell whether a service is there again, by another process."""
    now = m.unit(name)
    return now["ActiveState"] == "active" and now["MainPID"] not in ("0", before["MainPID"])


def signal_main(m: Machine, name: str, number: str) -> None:
    """Send a signal to a service's main process, and to no other."""
    m.said("systemctl", "kill", "--kill-whom=main", f"--signal={number}", name)


def drives(m: Machine) -> float:
    """Have somebody drive laps, and return the speed once it moves."""
    if not active(m, "driver.service"):
        m.tried("systemctl", "reset-failed", "driver.service")
        m.write(DRIVER, Path(driver.__file__).read_text(encoding="utf-8"))
        m.said(
            "systemd-run", "--unit=driver", "--uid=t2", "--property=Restart=always",
            "/opt/t2/current/bin/python", "-P", DRIVER, "--config", SETTINGS,
        )  # fmt: skip
    return float(wait_until(lambda: moving(m), "a vehicle that drives", PATIENCE_S))


def moving(m: Machine) -> float:
    """Return the speed when it is one to speak of, else 0."""
    speed = abs(float(m.truth()["linear"]))
    return speed if speed > 0.1 else 0.0


def rests(m: Machine) -> None:
    """See that the board was not left with a RUN."""
    wait_until(lambda: m.truth()["holds"] != "run", "a STOP or BREAK", PATIENCE_S)
