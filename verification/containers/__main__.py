"""``python -m verification.containers``: test the containers of compose.yaml.

Without a Docker engine it prints why it did not run, with exit code 0.
"""

import argparse
import secrets
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from verification.containers import crashes, isolation, operation, upgrade
from verification.containers.base import base, wheelhouse
from verification.containers.engine import docker, missing
from verification.containers.stack_fixture import StackFixture, progress, stack_fixture
from verification.harness.results import table

Check = Callable[[StackFixture], str]
CHECKS: Sequence[tuple[str, Check]] = (
    ("start", operation.all_services_are_healthy),
    ("a lap over TLS", operation.lap_is_driven),
    ("recording", operation.recording_is_written),
    ("image size", isolation.image_is_small),
    ("no tools in the image", isolation.image_has_no_tools),
    ("rights", isolation.rights_are_minimal),
    ("read-only root", isolation.root_is_read_only),
    ("limits", isolation.resources_are_limited),
    ("networks", isolation.networks_are_minimal),
    ("dashboard token", isolation.dashboard_requires_its_token),
    ("a laptop's container", operation.laptop_container_connects),
    ("settings for zenohd", operation.router_settings_are_written),
    ("cost of a health check", operation.health_check_is_cheap),
    ("bridge process killed", partial(crashes.process_is_killed, "services.bridge.child")),
    ("guard killed", partial(crashes.process_is_killed, "services.bridge")),
    ("bridge container killed", partial(crashes.container_is_killed, "bridge")),
    ("safety container killed", partial(crashes.container_is_killed, "safety")),
    ("router container killed", partial(crashes.container_is_killed, "router")),
    ("odom container killed", partial(crashes.optional_container_is_killed, "odom")),
    ("recorder container killed", partial(crashes.optional_container_is_killed, "recorder")),
    ("dashboard container killed", partial(crashes.optional_container_is_killed, "dashboard")),
    ("safety container paused", partial(crashes.container_is_paused, "safety")),
    ("router container paused", partial(crashes.container_is_paused, "router")),
    ("laptops' network cut", crashes.laptop_network_is_cut),
    ("odom hangs", crashes.hang_is_detected),
    ("odom upgraded, and back", upgrade.one_service_is_upgraded),
    ("logs", operation.logs_are_valid),
)
KEPT = "test-kept"


@dataclass(frozen=True, slots=True)
class Row:
    """The result of one check."""

    what: str
    seen: str
    fine: bool
    took_s: float


def main(argv: Sequence[str] | None = None) -> int:
    """Run all checks; return 1 when one fails."""
    parser = argparse.ArgumentParser(prog="python -m verification.containers", description=__doc__)
    parser.add_argument("only", nargs="*", help="only checks whose name contains one of these")
    parser.add_argument(
        "--keep-wheelhouse", action="store_true", help="use build/wheelhouse as it is"
    )
    parser.add_argument("--keep", action="store_true", help="keep the images for the next run")
    parser.add_argument("--built", action="store_true", help="with --keep: use the kept images")
    options = parser.parse_args(argv)
    checks = [
        each for each in CHECKS if not options.only or any(o in each[0] for o in options.only)
    ]
    lacks = missing()
    if lacks:
        print(f"compose-test: NOT RUN: {lacks}")
        return 0
    rows: list[Row] = []
    tag = KEPT if options.keep else f"test{secrets.token_hex(3)}"
    with tempfile.TemporaryDirectory() as folder:
        image = base()
        if not (options.keep_wheelhouse or options.built):
            wheelhouse(image)
        with stack_fixture(
            Path(folder), image, tag, keep=options.keep, built=options.built
        ) as fixture:
            rows += [run_check(fixture, *each) for each in checks]
        if not options.keep:
            rows.append(everything_is_removed(tag))
    print(markdown(rows))
    return int(not all(row.fine for row in rows))


def run_check(fixture: StackFixture, what: str, check: Check) -> Row:
    """Run one check."""
    progress(what)
    began_s = time.monotonic()
    try:
        seen, fine = check(fixture), True
    except Exception as error:  # any error fails this check only
        seen, fine = f"{type(error).__name__}: {error}", False
    progress(f"{'ok' if fine else 'WRONG'}: {seen}")
    fixture.driver.linear = 0.0
    return Row(what, seen, fine, time.monotonic() - began_s)


def everything_is_removed(tag: str) -> Row:
    """Check that no container, volume, network or image of the project is left."""
    mine = f"name=t2-{tag}"
    left = [
        docker("ps", "--all", "--quiet", "--filter", mine),
        docker("volume", "ls", "--quiet", "--filter", mine),
        docker("network", "ls", "--quiet", "--filter", mine),
        docker("image", "ls", "--quiet", "--filter", f"reference=t2-*:{tag}*"),
    ]
    return Row("taken down", "; ".join(filter(None, left)) or "nothing is left", not any(left), 0.0)


def markdown(rows: Sequence[Row]) -> str:
    """Return the table of the results."""
    cells = [
        [row.what, _cell(row.seen), "ok" if row.fine else "WRONG", f"{row.took_s:.0f} s"]
        for row in rows
    ]
    return table(["what", "seen", "", "took"], cells)


def _cell(text: str) -> str:
    """Return a text as one line without column separators."""
    return " ".join(text.replace("|", "/").split())[:400]


if __name__ == "__main__":
    sys.exit(main())
