"""``t2 install``: install T2's services as systemd units on this computer; needs root.

It writes the units and their user, disables the computer's sleep, and creates missing settings. It
starts nothing, and never changes an operator's files: the settings, drop-ins of `systemctl edit`.
"""

import argparse
import os
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from cli.settings import Everything
from common.cli_args import file_path
from common.config import DEFAULT_FILE, Sources, load
from t2.errors import T2Error

TEMPLATES = Path(__file__).parents[2] / "deploy" / "systemd"
UNITS = Path("/usr/local/lib/systemd/system")
USER = Path("/etc/sysusers.d/t2.conf")
SLEEP = Path("/etc/systemd/sleep.conf.d/t2.conf")
SETTINGS = Path("/etc/t2/t2.toml")
KEYS = Path("/etc/t2/keys/bus.toml")  # from `t2 keys issue robot`; lets laptops connect
SIM = "t2-sim.service"
EXTRAS = {
    "t2-camera.service": "av",
    "t2-recorder.service": "mcap",
    "t2-dashboard.service": "uvicorn",
    "t2-ros2.service": "xxhash",
}
HIDDEN = ("/home", "/root", "/run/user", "/tmp", "/var/tmp")  # not visible to the units


@dataclass(frozen=True, slots=True)
class Host:
    """The files of a computer, or of a folder in its place; prints each change."""

    root: Path
    dry: bool

    def has(self, path: Path) -> bool:
        """Return whether a file or link exists."""
        return os.path.lexists(self.at(path))

    def at(self, path: Path) -> Path:
        """Return the actual path of a file of that computer."""
        return self.root / path.relative_to("/")

    def write(self, path: Path, text: str) -> None:
        """Write a file atomically, unless it is unchanged."""
        file = self.at(path)
        if file.exists() and file.read_bytes() == text.encode():
            print(f"same    {path}")
            return
        print(f"replace {path}" if file.exists() else f"write   {path}")
        if not self.dry:
            file.parent.mkdir(parents=True, exist_ok=True)
            part = file.with_name(f".{file.name}.part")
            part.write_text(text, encoding="utf-8")
            part.chmod(0o644)
            part.replace(file)

    def remove(self, path: Path) -> None:
        """Remove a file, if it exists."""
        if self.has(path):
            print(f"remove  {path}")
            if not self.dry:
                self.at(path).unlink()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "--prefix", type=file_path, default=here(), metavar="DIR",
        help="the Python environment with T2; this one by default",
    )  # fmt: skip
    parser.add_argument(
        "--root", type=file_path, default=Path("/"), metavar="DIR",
        help="write into this folder instead of /",
    )  # fmt: skip
    parser.add_argument(
        "--sim", action="store_true", help="install a simulated vehicle instead of a real one"
    )
    parser.add_argument(
        "--dry-run", action="store_true", help="print the changes without making them"
    )


def here() -> Path:
    """Return this environment, or t2-install.sh's link to it, if there is one."""
    prefix = Path(sys.prefix)
    current = prefix.parent / "current"
    return current if current.is_symlink() and current.resolve() == prefix.resolve() else prefix


def run(options: argparse.Namespace) -> int:
    """Write the files, and print the next commands; raise ``T2Error`` before."""
    host = Host(options.root.absolute(), options.dry_run)
    check_rights(host, options.prefix)
    check_prefix(options.prefix)
    install(host, options.prefix, options.sim)
    return 0


def install(host: Host, prefix: Path, sim: bool) -> None:
    """Write all files, and remove those that this computer cannot run any more."""
    given = [path for path in (SETTINGS, KEYS) if host.has(path)]
    # The settings must be valid for this version.
    load(Everything, Sources(files=(DEFAULT_FILE, *map(host.at, given)), environ={}))
    start = "enable --now t2.target"
    if host.has(UNITS / "t2.target"):
        start = "restart t2.target  # while the vehicle stands still"
    wanted = {USER: template("t2.sysusers"), SLEEP: template("t2.sleep")}
    options = " ".join(f"--config {path}" for path in dict.fromkeys((SETTINGS, *given)))
    for name in names_here(sim or host.has(UNITS / SIM)):
        text = template(name).replace("@PREFIX@", str(prefix))
        wanted[UNITS / name] = text.replace("@SETTINGS@", options)
    for path in sorted(ours() - wanted.keys()):
        host.remove(path)
    for path, text in sorted(wanted.items()):
        host.write(path, text)
    if host.has(SETTINGS):
        print(f"keep    {SETTINGS}")
    else:
        host.write(SETTINGS, settings(sim))
    print(f"next: systemd-sysusers\n      systemctl daemon-reload\n      systemctl {start}")


# --- files --------------------------------------------------------------------------------------


def names() -> list[str]:
    """Return every unit and drop-in, relative to the folder of units."""
    forms = ("*.service", "*.target", "*/*.conf")
    files = (path for form in forms for path in TEMPLATES.glob(form))
    return sorted(str(path.relative_to(TEMPLATES)) for path in files)


def ours() -> set[Path]:
    """Return every file that an installation may have, except the settings."""
    return {USER, SLEEP, *(UNITS / name for name in names())}


def names_here(sim: bool) -> list[str]:
    """Return the units for this computer, and print the ones that it cannot run."""
    left_out = {name for name, library in EXTRAS.items() if find_spec(library) is None}
    for name in sorted(left_out):
        print(f"without {name}: {EXTRAS[name]} is not installed")
    if not sim:
        left_out.add(SIM)
    return [name for name in names() if name.partition(".d/")[0] not in left_out]


def template(name: str) -> str:
    """Return a file of deploy/systemd."""
    return (TEMPLATES / name).read_text(encoding="utf-8")


def settings(sim: bool) -> str:
    """Return the initial settings of a robot: vehicle and on-board bus."""
    vehicle = "# A simulated vehicle.\n"
    if not sim:
        vehicle = (DEFAULT_FILE.parent / "vehicle.toml").read_text(encoding="utf-8")
    return vehicle + template("onboard.toml")


# --- checks -------------------------------------------------------------------------------------


def check_rights(host: Host, prefix: Path) -> None:
    """Raise ``T2Error`` if the files cannot be written."""
    if host.root == Path("/") and os.geteuid() != 0 and not host.dry:
        raise T2Error(
            f"needs root for {UNITS} and {SETTINGS.parent}: run `sudo {prefix}/bin/t2 install`; "
            "--dry-run or --root DIR shows the changes"
        )


def check_prefix(prefix: Path) -> None:
    """Raise ``T2Error`` if the sandboxed services could not access T2."""
    for place in HIDDEN:
        if prefix.is_relative_to(place):
            raise T2Error(
                f"services cannot access {place}, and T2 is in {prefix}: install it elsewhere, "
                "as deploy/t2-install.sh does"
            )
