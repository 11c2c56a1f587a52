"""The checks in their order; each returns its observation, or fails."""

import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import t2
from verification.harness.waiting import wait_until
from verification.soak import driver
from verification.systemd.machine import Machine

PATIENCE_S = 60.0
CORE = ("router", "safety", "bridge", "odom", "recorder")
UNITS = [f"t2-{name}.service" for name in CORE]
INSTALL = ("sh", "/wheelhouse/t2-install.sh")
SETTINGS = "/etc/t2/t2.toml"
T2 = "/opt/t2/current/bin/t2"
LAPS = "/opt/laps"  # the driver and the package t2, copied: they are not installed
DRIVER = f"{LAPS}/drive.py"
TRACE = """[Service]
StateDirectory=t2
ExecStart=
ExecStart=/opt/t2/current/bin/python -P -m sim --config /etc/t2/t2.toml --trace /var/lib/t2/trace
"""
PORT_HOLDER = """
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
    """Install from the wheelhouse, without a network."""
    started_s = time.monotonic()
    m.run(*INSTALL, "--sim")
    took_s = time.monotonic() - started_s
    again = m.run(*INSTALL)
    assert "exists already" in again, again
    assert "keep    /etc/t2/t2.toml" in again, again
    m.write(SETTINGS, m.run("cat", SETTINGS) + "\n[sim]\ncontrol_port = 4009\n")
    m.write("/etc/systemd/system/t2-sim.service.d/trace.conf", TRACE)
    m.run("systemd-sysusers")
    assert "AllowSuspend=no" in m.run("systemd-analyze", "cat-config", "systemd/sleep.conf")
    m.run("systemctl", "daemon-reload")
    size = m.run("sh", "-c", "du -smL /opt/t2/current | cut -f 1").strip()
    return f"in {took_s:.0f} s, {size} MB; the second run changes nothing"


def verifies(m: Machine) -> str:
    """Run systemd-analyze on the units."""
    output = m.run("systemd-analyze", "verify", "t2.target", *UNITS)
    assert not output.strip(), output
    marks = {}
    for name in UNITS:
        line = m.run("systemd-analyze", "security", name).strip().splitlines()[-1]
        found = re.search(r": ([\d.]+) (\w+)", line)
        assert found, line
        marks[name.removeprefix("t2-").removesuffix(".service")] = float(found[1])
    assert max(marks.values()) < 3, marks
    return "no warning; exposure " + ", ".join(f"{name} {mark}" for name, mark in marks.items())


def starts(m: Machine) -> str:
    """Start like an operator; units become ready in order."""
    started_s = time.monotonic()
    m.run("systemctl", "enable", "--now", "t2.target")
    took_s = time.monotonic() - started_s
    wait_until(lambda: all(active(m, name) for name in UNITS), "all active", PATIENCE_S)
    order = [int(m.unit(name)["ActiveEnterTimestampMonotonic"]) for name in UNITS[:3]]
    assert order == sorted(order), dict(zip(UNITS, order, strict=False))
    assert all(m.unit(name)["NRestarts"] == "0" for name in UNITS)
    return f"{len(UNITS)} active by notify in {took_s:.1f} s: router, safety, bridge"


def restricts_the_bus(m: Machine) -> str:
    """Only members of the group can connect to the bus socket."""
    seen = m.run("stat", "-c", "%A %U %G", "/run/t2", "/run/t2/bus.sock").split("\n")
    code = "import socket; socket.socket(socket.AF_UNIX).connect('/run/t2/bus.sock')"
    python = "/opt/t2/current/bin/python"
    refused = m.attempt(
        "setpriv", "--reuid=nobody", "--regid=nogroup", "--clear-groups", python, "-c", code
    )
    assert "PermissionError" in refused.stdout, refused.stdout
    m.run("setpriv", "--reuid=nobody", "--regid=nogroup", "--groups=t2", python, "-c", code)
    output = m.python("-m", "cli", "health", "--config", SETTINGS)
    assert "hangs" not in output, output
    return f"{seen[0]}, {seen[1]}: members of the group connect, others do not; `t2 health` is good"


def restricts_the_drive_link(m: Machine) -> str:
    """Only bridge and safety can connect to the drive link."""
    socket = "/run/t2-drive/drive.sock"
    seen = m.run("stat", "-c", "%A %U %G", "/run/t2-drive", socket).split("\n")
    assert seen[:2] == ["drwx------ t2 t2", "srw------- t2 t2"], seen
    for name in UNITS:
        enter = ("nsenter", "-m", "-t", m.unit(name)["MainPID"])
        inside = m.attempt(*enter, "stat", socket).returncode == 0
        assert inside == (name in ("t2-bridge.service", "t2-safety.service")), name
    return "only bridge and safety see the socket, owned by the user t2"


def watchdog_restarts(m: Machine) -> str:
    """Send SIGSTOP to each process: systemd, or the router's probe, kills it; it is restarted."""
    took = []
    for name in UNITS[:4]:
        drives(m)
        before = m.unit(name)
        started_s = time.monotonic()
        signal_main(m, name, "STOP")
        wait_until(lambda n=name, b=before: restarted(m, n, b), f"a restarted {name}", PATIENCE_S)  # type: ignore[misc]
        took.append(f"{name[3:-8]} {time.monotonic() - started_s:.1f} s")
        journal = m.run("journalctl", "-u", name, "-o", "cat").lower()
        killers = ["watchdog", "the router hangs"] if name == "t2-router.service" else ["watchdog"]
        assert any(killer in journal for killer in killers), journal
        wait_for_stop(m) if name == "t2-bridge.service" else None
    return "hang to READY: " + ", ".join(took)


def restarts_after_kill(m: Machine) -> str:
    """Kill each process: systemd restarts it, and the vehicle drives again."""
    took = []
    for name in UNITS:
        before = m.unit(name)
        started_s = time.monotonic()
        signal_main(m, name, "KILL")
        wait_until(lambda n=name, b=before: restarted(m, n, b), f"a restarted {name}", PATIENCE_S)  # type: ignore[misc]
        took.append(f"{name[3:-8]} {time.monotonic() - started_s:.1f} s")
    drives(m)
    return "kill to READY: " + ", ".join(took) + "; it drives"


def stops_in_order(m: Machine) -> str:
    """Stop all units while driving: the bridge first, and the board holds STOP or BRAKE."""
    speed = drives(m)
    m.run("systemctl", "stop", "t2.target", "t2-sim.service", *UNITS)
    ends = {
        n: int(m.unit(n)["InactiveEnterTimestampMonotonic"]) for n in [*UNITS, "t2-sim.service"]
    }
    bridge = ends["t2-bridge.service"]
    behind = ("t2-safety.service", "t2-router.service", "t2-sim.service")
    assert all(ends[name] >= bridge for name in behind), ends
    assert ends["t2-router.service"] >= ends["t2-safety.service"], ends
    lines = [
        json.loads(line) for line in m.run("tail", "-n", "400", "/var/lib/t2/trace").splitlines()
    ]
    last = [line for line in lines if line["event"] == "command"][-1]
    truth = [line for line in lines if line["event"] == "truth"][-1]
    # BRAKE, when stalls of the host kept the bridge from detecting standstill.
    assert last["kind"] in ("stop", "brake"), last
    results = {m.unit(name)["Result"] for name in UNITS}
    assert results == {"success"}, results
    held = f"{last['kind'].upper()} is the last command, at {truth['linear']:.2f} m/s"
    return f"from {speed:.2f} m/s: {held}; order: bridge, safety, router"


def accepts_certificates(m: Machine) -> str:
    """Install the robot's keys: a viewer connects over TLS, clients without certificate do not."""
    with tempfile.TemporaryDirectory() as folder:
        for words in ("init", "issue robot 001", "issue viewer anna"):
            command = [sys.executable, "-m", "cli", "keys", *words.split(), "--folder"]
            subprocess.run([*command, f"{folder}/keys"], check=True, stdout=subprocess.DEVNULL)
        m.copy(Path(folder) / "keys" / "robot.001", "/etc/t2/keys")
        m.copy(Path(folder) / "keys" / "viewer.anna", "/root/anna")
    m.run("chown", "-R", "t2:", "/etc/t2/keys")
    m.run(T2, "install")
    m.run("systemctl", "daemon-reload")
    m.run("systemctl", "start", "t2.target")
    wait_until(lambda: all(active(m, name) for name in UNITS), "all active", PATIENCE_S)
    here = ("--set", "bus.connect=tls/127.0.0.1:7447")
    see = (T2, "health", "--config", "/root/anna/bus.toml", *here)
    wait_until(
        lambda: m.attempt(*see).returncode == 0, "a viewer that sees all services", PATIENCE_S
    )
    refused = m.attempt(T2, "health", "--set", "bus.ca=/root/anna/ca.pem", *here)
    assert refused.returncode != 0, refused.stdout
    return (
        "with /etc/t2/keys: a viewer sees all services over TLS, a client without certificate none"
    )


def rejects_bad_settings(m: Machine) -> str:
    """A wrong setting ends a unit permanently; an occupied port is retried."""
    good = m.run("cat", SETTINGS)
    m.write(SETTINGS, good + "\n[odom]\nhold = 99.0\n")
    m.attempt("systemctl", "restart", "t2-odom.service")
    wait_until(
        lambda: m.unit("t2-odom.service")["ActiveState"] == "failed", "the failure", PATIENCE_S
    )
    unit = m.unit("t2-odom.service")
    assert (unit["ExecMainStatus"], unit["Result"]) == ("78", "exit-code"), unit
    output = m.run("journalctl", "-u", "t2-odom.service", "-o", "cat", "-n", "20")
    assert "odom.hold = 99.0" in output, output
    m.write(SETTINGS, good)
    m.run("systemctl", "stop", "t2-bridge.service")
    m.run("systemd-run", "--unit=taker", "/opt/t2/current/bin/python", "-c", PORT_HOLDER)
    m.run("systemctl", "start", "--no-block", "t2.target")
    wait_until(lambda: int(m.unit("t2-bridge.service")["NRestarts"]) >= 1, "a retry", PATIENCE_S)
    m.run("systemctl", "stop", "taker.service")
    wait_until(lambda: active(m, "t2-bridge.service"), "the bridge", PATIENCE_S)
    return "wrong setting: exit code 78, named in the journal; occupied port: retried until free"


def upgrades(m: Machine) -> str:
    """Install another build, roll back, and uninstall."""
    m.run("cp", "-r", "/wheelhouse", "/srv/next")
    m.run("sh", "-c", f"cd /srv/next; {REBUILD}")
    first = m.run("readlink", "/opt/t2/current")
    m.run("sh", "/srv/next/t2-install.sh")
    assert m.run("readlink", "/opt/t2/current") != first
    m.run("systemctl", "restart", "t2.target")
    wait_until(lambda: all(active(m, name) for name in UNITS), "the new version", PATIENCE_S)
    m.run(*INSTALL, "--rollback")
    assert m.run("readlink", "/opt/t2/current") == first
    m.run("systemctl", "restart", "t2.target")
    wait_until(lambda: all(active(m, name) for name in UNITS), "the old version", PATIENCE_S)
    assert "replace" not in m.run(T2, "install"), "its own prefix is the link"
    assert "disable --now" in m.attempt(T2, "install", "--uninstall").stdout
    m.run("systemctl", "disable", "--now", "t2.target")
    m.run(T2, "install", "--uninstall")
    assert m.attempt("systemctl", "cat", "t2-odom.service").returncode != 0
    m.run("test", "-f", SETTINGS)
    return "upgrade and rollback; uninstalled, the settings remain"


CHECKS: list[Callable[[Machine], str]] = [
    installs, verifies, starts, restricts_the_bus, restricts_the_drive_link, watchdog_restarts,
    restarts_after_kill, stops_in_order, accepts_certificates, rejects_bad_settings, upgrades,
]  # fmt: skip


# --- access to the machine ----------------------------------------------------------------------


def active(m: Machine, name: str) -> bool:
    """Return whether a unit is ready."""
    return m.unit(name)["ActiveState"] == "active"


def restarted(m: Machine, name: str, before: dict[str, str]) -> bool:
    """Return whether a service is ready with a new process."""
    now = m.unit(name)
    return now["ActiveState"] == "active" and now["MainPID"] not in ("0", before["MainPID"])


def signal_main(m: Machine, name: str, number: str) -> None:
    """Send a signal to the main process of a unit only."""
    m.run("systemctl", "kill", "--kill-whom=main", f"--signal={number}", name)


def drives(m: Machine) -> float:
    """Start the driver of laps, and return the speed once the vehicle moves."""
    if not active(m, "driver.service"):
        m.attempt("systemctl", "reset-failed", "driver.service")
        if m.attempt("test", "-e", LAPS).returncode:
            m.copy(Path(t2.__file__).parent.parent, LAPS)
        m.write(DRIVER, Path(driver.__file__).read_text(encoding="utf-8"))
        m.run(
            "systemd-run", "--unit=driver", "--uid=t2", "--property=Restart=always",
            f"--setenv=PYTHONPATH={LAPS}",
            "/opt/t2/current/bin/python", "-P", DRIVER, "--config", SETTINGS,
        )  # fmt: skip
    return float(wait_until(lambda: moving(m), "a moving vehicle", PATIENCE_S))


def moving(m: Machine) -> float:
    """Return the speed when it is above 0.1 m/s, else 0."""
    speed = abs(float(m.truth()["linear"]))
    return speed if speed > 0.1 else 0.0


def wait_for_stop(m: Machine) -> None:
    """Wait until the board does not hold a RUN."""
    wait_until(lambda: m.truth()["holds"] != "run", "a STOP or BRAKE", PATIENCE_S)
