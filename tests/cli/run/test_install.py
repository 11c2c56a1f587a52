"""``t2 install`` into a folder: files written, kept, rejected and removed."""

from configparser import ConfigParser
from pathlib import Path

import pytest

from cli.__main__ import main
from cli.run import install
from cli.settings import Everything
from common import realtime
from common.cli_args import EXIT_CONFIG
from common.config import DEFAULT_FILE, Sources, load

PREFIX = "/opt/t2/current"
UNITS = "usr/local/lib/systemd/system"
OPT_IN = {"t2-ros2.service", "t2-camera.service"}  # lets ROS nodes drive; needs a source


def t2_install(root: Path, *words: str) -> int:
    return main(["install", "--root", str(root), "--prefix", PREFIX, *words])


def files(root: Path) -> dict[str, str]:
    """Return the text of every file in a folder, by relative path."""
    found = (path for path in root.rglob("*") if path.is_file())
    return {str(path.relative_to(root)): path.read_text() for path in found}


def settings(root: Path) -> Everything:
    sources = Sources(files=(DEFAULT_FILE, root / "etc/t2/t2.toml"), environ={})
    return load(Everything, sources).config


def unit(text: str) -> ConfigParser:
    """Parse a unit; the last value of a repeated key counts."""
    parser = ConfigParser(strict=False, interpolation=None, delimiters=("=",))
    parser.optionxform = str  # type: ignore[assignment, method-assign]
    parser.read_string(text)
    return parser


def test_all_units_except_the_simulator(tmp_path: Path) -> None:
    assert t2_install(tmp_path, "--dry-run") == 0
    assert files(tmp_path) == {}
    assert t2_install(tmp_path) == 0
    written = files(tmp_path)
    services = {Path(name).name for name in written if name.endswith(".service")}
    names = (
        "router",
        "bridge",
        "safety",
        "odom",
        "localization",
        "patrol",
        "recorder",
        "dashboard",
        "ros2",
        "camera",
    )
    assert services == {f"t2-{name}.service" for name in names}
    assert not any("@PREFIX@" in text for text in written.values())
    start = f"ExecStart={PREFIX}/bin/python -P -m services.safety --config /etc/t2/t2.toml"
    assert start in written[f"{UNITS}/t2-safety.service"]
    wants = " ".join(x for x in written[f"{UNITS}/t2.target"].splitlines() if "Wants=" in x)
    assert {name for name in services if name not in wants} == OPT_IN
    for name in OPT_IN:
        assert unit(written[f"{UNITS}/{name}"])["Install"]["WantedBy"] == "t2.target"
    sleep = unit(written["etc/systemd/sleep.conf.d/t2.conf"])["Sleep"]
    assert len(sleep) == 4
    assert set(sleep.values()) == {"no"}
    assert written["etc/sysusers.d/t2.conf"].splitlines()[-1].startswith("u t2 ")


def test_initial_settings_are_valid_and_existing_keys_are_used(tmp_path: Path) -> None:
    keys = tmp_path / "etc/t2/keys/bus.toml"
    keys.parent.mkdir(parents=True)
    keys.write_text('[bus]\nlisten = ["unixsock-stream//run/t2/bus.sock", "tcp/127.0.0.1:7447"]\n')
    t2_install(tmp_path)
    command = unit(files(tmp_path)[f"{UNITS}/t2-router.service"])["Service"]["ExecStart"]
    assert command.endswith(" --config /etc/t2/t2.toml --config /etc/t2/keys/bus.toml")
    config = settings(tmp_path)
    assert config.board.address == "10.7.5.224"
    assert config.bus.endpoints == ("unixsock-stream//run/t2/bus.sock",)
    assert config.recorder.folder == "/var/lib/t2/recordings"
    assert config.patrol.folder == "/var/lib/t2/patrol"


def test_a_simulated_vehicle_stays(tmp_path: Path) -> None:
    for words in (["--sim"], []):
        t2_install(tmp_path, *words)
        assert f"{UNITS}/t2-sim.service" in files(tmp_path)
        assert settings(tmp_path).board.address == "127.0.0.1"


def test_install_again_keeps_edited_settings_and_renews_the_units(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    t2_install(tmp_path)
    (tmp_path / "etc/t2/t2.toml").write_text('[robot]\nid = "007"\n')
    before = files(tmp_path)
    (tmp_path / UNITS / "t2-odom.service").write_text("older\n")
    assert t2_install(tmp_path) == 0
    assert files(tmp_path) == before
    monkeypatch.setattr(
        install, "find_spec", lambda name: None if name in ("uvicorn", "av") else True
    )
    t2_install(tmp_path)
    camera = f"{UNITS}/t2-camera.service"
    absent = {f"{UNITS}/t2-dashboard.service", camera, f"{camera}.d/20-devices.conf"}
    assert files(tmp_path).keys() == before.keys() - absent


def test_invalid_settings_write_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings = tmp_path / "etc/t2/t2.toml"
    settings.parent.mkdir(parents=True)
    settings.write_text("[bus]\nlaese = 1.0\n")
    assert t2_install(tmp_path) == EXIT_CONFIG
    assert "bus.laese: unknown; did you mean 'lease'?" in capsys.readouterr().err
    assert list(files(tmp_path)) == ["etc/t2/t2.toml"]


def test_install_needs_root_and_a_prefix_that_services_see(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["install", "--root", str(tmp_path), "--prefix", "/home/t2"]) == 1
    assert "T2 is in /home/t2: install it elsewhere" in capsys.readouterr().err
    assert files(tmp_path) == {}
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    assert main(["install", "--prefix", PREFIX]) == 1
    assert "needs root" in capsys.readouterr().err


# --- the units ----------------------------------------------------------------------------------

SERVICES = sorted(path.name for path in install.TEMPLATES.glob("t2-*.service"))


@pytest.mark.parametrize("name", SERVICES)
def test_a_unit_has_a_watchdog_and_only_what_it_needs(name: str) -> None:
    service = unit(install.template(name))["Service"]
    if name != install.SIM:
        assert service["Type"] == "notify"
        assert int(service["WatchdogSec"].removesuffix("s")) >= 2  # hosts with scheduling stalls
        denied = {*service.get("IPAddressDeny", "").split()}
        cable = {"10.7.5.0/24", "255.255.255.255", "multicast"}  # as in deploy/nftables/t2.nft
        assert ("any" in denied or cable <= denied) == (name != "t2-bridge.service")
    ahead = name in ("t2-router.service", "t2-safety.service", "t2-bridge.service")
    assert service.get("LimitRTPRIO") == (str(realtime.GUARD) if ahead else None)
    assert service.get("RestrictRealtime") == (None if ahead else "yes")
    hidden = service.get("InaccessiblePaths") == "/run/t2-drive"
    assert hidden == (name not in ("t2-bridge.service", "t2-safety.service"))
    assert (service.get("ReadWritePaths") == "/run/t2-drive") == (name == "t2-bridge.service")
    common = unit(install.template("t2-.service.d/10-t2.conf"))["Service"]
    assert not common.keys() & service.keys()


def test_the_bridge_starts_last_and_stops_first() -> None:
    after = unit(install.template("t2-bridge.service"))["Unit"]["After"].split()
    assert {"network.target", "t2-router.service", "t2-safety.service", "t2-sim.service"} == {
        *after
    }
    for name in SERVICES:
        assert "t2-bridge" not in unit(install.template(name))["Unit"].get("After", "")
