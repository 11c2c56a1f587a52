"""``python -m verification.fleet``: measure N robots behind one site router.

Two robots are real stacks with their own routers, the others are simulated. One real robot is
driven from the site. Raw samples go to ``out/fleet``; ``--out`` renews the tables of a document.
"""

import argparse
import contextlib
import io
import platform
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgspec

from cli.inspect.addressing import EVERY_ROBOT
from cli.inspect.estop import stop
from cli.inspect.robots import discover
from common.bus.probe import probe
from verification.fleet.figures import Window, markdown, shares, uplinks
from verification.fleet.page import scale, units
from verification.fleet.plot import save
from verification.fleet.topology import REAL, Fleet, simulated_robots, site, stack, window
from verification.harness.bus import at
from verification.harness.host import description
from verification.harness.results import filled

SIZES = "1,2,5,10,20,50"
SUBSCRIPTIONS = ("nothing", "overview", "everything")
THIN_HZ = 10.0
RAW = Path("out/fleet")
SAMPLES_FILE = RAW / "measured.json"
PICTURE = "images/fleet.png"


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, store the samples, and print the tables."""
    options = arguments().parse_args(argv)
    RAW.mkdir(parents=True, exist_ok=True)
    if not options.again:
        SAMPLES_FILE.write_bytes(msgspec.json.encode(measure(sizes(options), options.seconds)))
    blocks, windows = evaluated(msgspec.json.decode(SAMPLES_FILE.read_bytes()))
    for name, block in blocks.items():
        print(f"{name}\n{block}\n")
    save(RAW / "fleet.png", windows)
    if options.out:
        page = options.out.read_text(encoding="utf-8")
        options.out.write_text(filled(page, blocks), encoding="utf-8")
        save(options.out.parent / PICTURE, windows)
    return 0


def sizes(options: argparse.Namespace) -> list[int]:
    """Return the numbers of robots, ascending."""
    smaller = {int(text) for text in options.sizes.split(",") if int(text) < options.robots}
    return sorted(smaller | {options.robots})


def measure(sizes: Sequence[int], seconds: float) -> dict[str, object]:
    """Return all results."""
    windows: list[Window] = []
    with tempfile.TemporaryDirectory() as folder, site() as fleet:
        for made in measured(fleet, Path(folder), sizes, seconds):
            windows.append(made)
            print(markdown([made]).splitlines()[-1], file=sys.stderr, flush=True)
        return {
            "machine": machine(seconds),
            "windows": windows,
            "estop": stopped(fleet, sizes[-1]),
        }


def evaluated(stored: dict[str, Any]) -> tuple[dict[str, str], list[Window]]:
    """Return the blocks of the document, and the windows."""
    windows: list[Window] = stored["windows"]
    return {
        "machine": stored["machine"], "windows": markdown(windows), "uplinks": uplinks(windows),
        "shares": shares(windows), "estop": stored["estop"], "units": units(windows),
        "scale": scale(windows),
    }, windows  # fmt: skip


def measured(fleet: Fleet, folder: Path, sizes: Sequence[int], seconds: float) -> Iterator[Window]:
    """Yield the windows; the real stacks run all the time."""
    with contextlib.ExitStack() as stacks:
        for size in sizes:
            while len(fleet.stacks) < min(size, REAL):
                stacks.enter_context(stack(fleet, folder))
            if size == 1:
                own = fleet.stacks[0].endpoint
                yield window(fleet, "nothing", seconds, own) | TAGS | {"what": "at its own router"}
            yield from windows_of(fleet, size, seconds, SUBSCRIPTIONS)
            if size > REAL:
                yield from windows_of(fleet, size, seconds, ("everything",), thin=THIN_HZ)
        yield from windows_of(fleet, sizes[-1], seconds, ("nothing", "everything"), shape="router")


TAGS = {"shape": "peer", "thin": 0.0}


def windows_of(
    fleet: Fleet,
    size: int,
    seconds: float,
    subscriptions: Sequence[str],
    *,
    shape: str = "peer",
    thin: float = 0.0,
) -> Iterator[Window]:
    """Yield a window for each subscription, with this number of robots."""
    with simulated_robots(fleet, size, shape, thin):
        for what in subscriptions:
            made = window(fleet, what, seconds, fleet.site)
            yield made | {"shape": shape, "thin": thin}


def stopped(fleet: Fleet, robots: int) -> str:
    """Stop all simulated robots; return a sentence on the time until all have confirmed."""
    with simulated_robots(fleet, robots, "peer", 0.0), probe(at(fleet.site)) as opened:
        found = len(discover(opened, EVERY_ROBOT))
        with contextlib.redirect_stdout(io.StringIO()) as output:
            begin_s = time.monotonic()
            code = stop(opened, EVERY_ROBOT)
            took_s = time.monotonic() - begin_s
    names = output.getvalue().count("is stopped")
    return (
        f"`t2 robots` listed {found} of {robots}. `t2 estop --all`: {names} of {robots} confirmed, "
        f"exit code {code}, after {took_s:.2f} s."
    )


def machine(seconds: float) -> str:
    """Return the sentence on host, versions and duration."""
    return (
        f"Made by `make fleet` on {datetime.now(UTC):%Y-%m-%d}: {description()}, Python "
        f"{platform.python_version()}, eclipse-zenoh {version('eclipse-zenoh')}; "
        f"{seconds:g} s a row."
    )


def arguments() -> argparse.ArgumentParser:
    """Return the argument parser."""
    parser = argparse.ArgumentParser(prog="fleet", description=__doc__)
    parser.add_argument("--robots", type=int, default=50, metavar="N", help="largest number, 50")
    parser.add_argument("--sizes", default=SIZES, metavar="N,N", help=f"smaller numbers, {SIZES}")
    parser.add_argument(
        "--seconds", type=float, default=10.0, metavar="S", help="duration of each row, 10"
    )
    parser.add_argument("--again", action="store_true", help="use the stored samples")
    parser.add_argument("--out", type=Path, metavar="FILE", help="the document to renew")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
