"""The wheelhouse and the units, on a Debian with systemd and without a network."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from itertools import product
from pathlib import Path

from t2.errors import LinkError
from verification.harness.waiting import wait_until
from verification.system.frame import (
    PATIENCE_S,
    ROOT,
    Container,
    Vehicle,
    booted,
    debian,
    issue_keys,
    run,
    wheelhouse,
)

UNITS = [
    f"t2-{name}.service"
    for name in ("router", "safety", "bridge", "odom", "localization", "patrol", "recorder")
]
ROUTER, SAFETY, BRIDGE, *OTHERS, _ = UNITS
ODOM = OTHERS[0]
INSTALL = ("sh", "/wheelhouse/t2-install.sh")
SETTINGS = "/etc/t2/t2.toml"
T2, PYTHON = "/opt/t2/current/bin/t2", "/opt/t2/current/bin/python"
CONTROL_PORT = 4009
SIM = f'[sim]\nworld = "empty"\ncontrol_port = {CONTROL_PORT}\n'
NOBODY = ("setpriv", "--reuid=nobody", "--regid=nogroup")
CONNECT = "import socket; socket.socket(socket.AF_UNIX).connect('/run/t2/bus.sock')"


@contextmanager
def started() -> Iterator[Container]:
    """Boot the computer, with the wheelhouse at /wheelhouse."""
    wheelhouse(debian(), "robot")
    with booted(debian(), f"--volume={ROOT}/build/wheelhouse:/wheelhouse:ro") as machine:
        yield machine


def wait_active(m: Container) -> None:
    """Wait until the units are ready."""

    def active() -> bool:
        return all(m.unit(name)["ActiveState"] == "active" for name in UNITS)

    wait_until(active, "active units", PATIENCE_S)


def append(m: Container, settings: str) -> None:
    """Append a section to the settings."""
    m.run("sh", "-c", f'echo "$0" >> {SETTINGS}', settings)


# --- the checks -----------------------------------------------------------------------------------


def installs(m: Container) -> str:
    """Install from the wheelhouse without a network, with the robot's keys."""
    with tempfile.TemporaryDirectory() as folder:
        issue_keys(Path(folder) / "keys", "robot 001", "viewer anna")
        m.run("mkdir", "/etc/t2")
        run("docker", "cp", f"{folder}/keys/robot.001", f"{m.name}:/etc/t2/keys")
        run("docker", "cp", f"{folder}/keys/viewer.anna", f"{m.name}:/root/anna")
    m.run(*INSTALL, "--sim")
    m.run("systemd-sysusers")
    m.run("chown", "-R", "t2:", "/etc/t2/keys")
    append(m, SIM)
    assert "AllowSuspend=no" in m.run("systemd-analyze", "cat-config", "systemd/sleep.conf")
    m.run("systemctl", "daemon-reload")
    return f"{m.run('sh', '-c', 'du -smL /opt/t2/current | cut -f 1')} MB; does not sleep"


def verifies(m: Container) -> str:
    """Run systemd-analyze on the units."""
    done = m.attempt("systemd-analyze", "verify", "t2.target", *UNITS)
    assert not done.stdout + done.stderr, done
    m.run("systemd-analyze", "security", "--threshold=29", *UNITS)
    return "no warning; exposure below 3 of 10"


def starts(m: Container) -> str:
    """Start like an operator: the units become ready in their order."""
    m.run("systemctl", "enable", "--now", "t2.target")
    wait_active(m)
    order = [int(m.unit(name)["ActiveEnterTimestampMonotonic"]) for name in UNITS[:3]]
    assert order == sorted(order), order
    assert all(m.unit(name)["NRestarts"] == "0" for name in UNITS)
    return f"{m.run('systemctl', '--version').splitlines()[0]}: router, safety, bridge"


def restricts_access(m: Container) -> str:
    """The bus is for the group t2 and certificates, the drive link for bridge and safety."""
    refused = m.attempt(*NOBODY, "--clear-groups", PYTHON, "-c", CONNECT)
    assert "PermissionError" in refused.stderr, refused
    m.run(*NOBODY, "--groups=t2", PYTHON, "-c", CONNECT)
    see = (T2, "health", "--set", "bus.connect=tls/127.0.0.1:7447")
    anna = (*see, "--config", "/root/anna/bus.toml")
    wait_until(lambda: m.attempt(*anna).returncode == 0, "health over TLS", PATIENCE_S)
    assert m.attempt(*see, "--set", "bus.ca=/root/anna/ca.pem").returncode != 0
    link = "/run/t2-drive/drive.sock"
    modes = m.run("stat", "-c", "%A %U %G", "/run/t2-drive", link).splitlines()
    assert modes == ["drwx------ t2 t2", "srw------- t2 t2"], modes
    for name in UNITS:
        enter = ("nsenter", "-m", "-t", m.unit(name)["MainPID"])
        inside = m.attempt(*enter, "stat", link).returncode == 0
        assert inside == (name in (BRIDGE, SAFETY)), name
    return "group t2 and a viewer's certificate on the bus; bridge and safety on the drive link"


def restarts(m: Container) -> str:
    """Hang and kill each process: systemd restarts it, and the vehicle drives again."""
    with Vehicle(m, CONTROL_PORT) as vehicle:
        for name, signal in product(UNITS[:-1], ("STOP", "KILL")):
            before = m.unit(name)["MainPID"]
            kill = ("systemctl", "kill", "--kill-whom=main", f"--signal={signal}", name)
            if name in OTHERS:
                m.run(*kill)
            else:
                vehicle.stops_after(partial(m.run, *kill), PATIENCE_S)
            wait_until(partial(has_restarted, m, name, before), f"a new {name}", PATIENCE_S)
            vehicle.drive()
        journal = m.run("journalctl", "-u", "t2-*", "-o", "cat").lower()
    hung = SAFETY, BRIDGE, *OTHERS
    assert all(f"{name}: watchdog timeout" in journal for name in hung), journal
    return "each but the recorder: after SIGSTOP by the watchdog, and after SIGKILL"


def has_restarted(m: Container, name: str, before: str) -> bool:
    """Return whether a unit is ready with a new process."""
    unit = m.unit(name)
    return unit["ActiveState"] == "active" and unit["MainPID"] not in ("0", before)


def stops_in_order(m: Container) -> str:
    """Stop the target while driving: the bridge first, and the board holds STOP or BRAKE."""
    with Vehicle(m, CONTROL_PORT) as vehicle:
        vehicle.drive()
        last = vehicle.truth()
        m.run("systemctl", "stop", "--no-block", "t2.target")
        with suppress(LinkError):  # the simulated board stops as well
            while True:
                last = vehicle.truth()
    m.run("systemctl", "stop", *UNITS)  # waits for the end
    # BRAKE, when stalls of the host kept the bridge from detecting standstill.
    assert last.command.kind in ("stop", "brake"), last
    units = {name: m.unit(name) for name in (*UNITS, "t2-sim.service")}
    ends = {name: int(unit["InactiveEnterTimestampMonotonic"]) for name, unit in units.items()}
    assert ends[BRIDGE] <= min(ends[SAFETY], ends["t2-sim.service"]), ends
    assert ends[SAFETY] <= ends[ROUTER], ends
    assert {units[name]["Result"] for name in UNITS} == {"success"}, units
    return f"{last.command.kind.upper()} is the last command, at {last.linear:.2f} m/s"


def rejects_bad_settings(m: Container) -> str:
    """A wrong setting ends a unit for good, with the reason in its journal."""
    append(m, "[odom]\nturn_noise = 99.0\n")
    m.run("systemctl", "start", "t2.target")
    wait_until(lambda: m.unit(ODOM)["ActiveState"] == "failed", "the failure", PATIENCE_S)
    unit = m.unit(ODOM)
    assert (unit["ExecMainStatus"], unit["Result"]) == ("78", "exit-code"), unit
    assert "odom.turn_noise = 99.0" in m.run("journalctl", "-u", ODOM, "-o", "cat", "-n", "20")
    return "exit code 78, named in the journal"


CHECKS = (
    installs, verifies, starts, restricts_access, restarts, stops_in_order, rejects_bad_settings,
)  # fmt: skip
