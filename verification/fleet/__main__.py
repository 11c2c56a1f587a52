"""``python -m verification.fleet``: N robots behind one site router on this machine, measured.

Two are real stacks, each with a router of its own; the others are light. One real robot is driven
from the site. Raw samples go to ``out/fleet``; ``--out`` renews the tables of a document.
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
from cli.inspect.robots import look
from common.bus.probe import probe
from verification.fleet.figures import Window, markdown, shares, uplinks
from verification.fleet.page import scale, units
from verification.fleet.plot import save
from verification.fleet.topology import REAL, Ground, crowd, site, stack, window
from verification.harness.bus import at
from verification.harness.host import description
from verification.harness.results import filled

SIZES = "1,2,5,10,20,50"
LOOKS = ("nobody", "overview", "everything")
THIN_HZ = 10.0
RAW = Path("out/fleet")
KEPT = RAW / "measured.json"
PICTURE = "images/fleet.png"


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print the tables, and keep what was measured."""
    options = arguments().parse_args(argv)
    RAW.mkdir(parents=True, exist_ok=True)
    if not options.again:
        KEPT.write_bytes(msgspec.json.encode(measure(sizes(options), options.seconds)))
    blocks, windows = told(msgspec.json.decode(KEPT.read_bytes()))
    for name, block in blocks.items():
        print(f"{name}\n{block}\n")
    save(RAW / "fleet.png", windows)
    if options.out:
        page = options.out.read_text(encoding="utf-8")
        options.out.write_text(filled(page, blocks), encoding="utf-8")
        save(options.out.parent / PICTURE, windows)
    return 0


def sizes(options: argparse.Namespace) -> list[int]:
    """Return how many robots, one number after the other."""
    smaller = {int(text) for text in options.sizes.split(",") if int(text) < options.robots}
    return sorted(smaller | {options.robots})


def measure(sizes: Sequence[int], seconds: float) -> dict[str, object]:
    """Return all that was measured."""
    windows: list[Window] = []
    with tempfile.TemporaryDirectory() as folder, site() as ground:
        for made in measured(ground, Path(folder), sizes, seconds):
            windows.append(made)
            print(markdown([made]).splitlines()[-1], file=sys.stderr, flush=True)
        return {
            "machine": machine(seconds),
            "windows": windows,
            "estop": stopped(ground, sizes[-1]),
        }


def told(kept: dict[str, Any]) -> tuple[dict[str, str], list[Window]]:
    """Return the blocks of the document, and the windows."""
    windows: list[Window] = kept["windows"]
    return {
        "machine": kept["machine"], "windows": markdown(windows), "uplinks": uplinks(windows),
        "shares": shares(windows), "estop": kept["estop"], "units": units(windows),
        "scale": scale(windows),
    }, windows  # fmt: skip


def measured(
    ground: Ground, folder: Path, sizes: Sequence[int], seconds: float
) -> Iterator[Window]:
    """Yield the windows, the real stacks running all the while."""
    with contextlib.ExitStack() as stacks:
        for size in sizes:
            while len(ground.stacks) < min(size, REAL):
                stacks.enter_context(stack(ground, folder))
            if size == 1:
                own = ground.stacks[0].endpoint
                yield window(ground, "nobody", seconds, own) | TAGS | {"what": "at its own router"}
            yield from crowded(ground, size, seconds, LOOKS)
            if size > REAL:
                yield from crowded(ground, size, seconds, ("everything",), thin=THIN_HZ)
        yield from crowded(ground, sizes[-1], seconds, ("nobody", "everything"), shape="router")


TAGS = {"shape": "peer", "thin": 0.0}


def crowded(
    ground: Ground,
    size: int,
    seconds: float,
    looks: Sequence[str],
    *,
    shape: str = "peer",
    thin: float = 0.0,
) -> Iterator[Window]:
    """Yield a window for each look at so many robots."""
    with crowd(ground, size, shape, thin):
        for what in looks:
            made = window(ground, what, seconds, ground.site)
            yield made | {"shape": shape, "thin": thin}


def stopped(ground: Ground, robots: int) -> str:
    """Stop them all, light ones alone by now, and say how long it took until all had confirmed."""
    with crowd(ground, robots, "peer", 0.0), probe(at(ground.site)) as opened:
        found = len(look(opened, EVERY_ROBOT))
        with contextlib.redirect_stdout(io.StringIO()) as told:
            begin_s = time.monotonic()
            code = stop(opened, EVERY_ROBOT)
            took_s = time.monotonic() - begin_s
    names = told.getvalue().count("is stopped")
    return (
        f"`t2 robots` listed {found} of {robots}. `t2 estop --all`: {names} of {robots} confirmed, "
        f"exit code {code}, after {took_s:.2f} s."
    )


def machine(seconds: float) -> str:
    """Return where and how it was measured."""
    return (
        f"Made by `make fleet` on {datetime.now(UTC):%Y-%m-%d}: {description()}, Python "
        f"{platform.python_version()}, eclipse-zenoh {version('eclipse-zenoh')}; "
        f"{seconds:g} s a row."
    )


def arguments() -> argparse.ArgumentParser:
    """Return what the command line may say."""
    parser = argparse.ArgumentParser(prog="fleet", description=__doc__)
    parser.add_argument("--robots", type=int, default=50, metavar="N", help="at most, 50")
    parser.add_argument("--sizes", default=SIZES, metavar="N,N", help=f"smaller ones, {SIZES}")
    parser.add_argument("--seconds", type=float, default=10.0, metavar="S", help="of each row")
    parser.add_argument("--again", action="store_true", help="tell what was measured last")
    parser.add_argument("--out", type=Path, metavar="FILE", help="the document to renew")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
