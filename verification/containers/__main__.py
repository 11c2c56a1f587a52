"""``python -m verification.containers``: build, start, drive, kill, cut, upgrade, read logs, stop.

Without a Docker engine it says that it did not run, and why; that is no failure.
"""

import argparse
import secrets
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from verification.containers import crashes, drives, rights, upgrade
from verification.containers.base import base, wheelhouse
from verification.containers.engine import docker, missing
from verification.containers.stack_fixture import Stage, say, staged
from verification.containers.table import Row, markdown

Look = Callable[[Stage], str]
LOOKS: Sequence[tuple[str, Look]] = (
    ("all come up", drives.all_fare_well),
    ("a lap over TLS", drives.lap_is_driven),
    ("the black box", drives.black_box_is_written),
    ("the robot's image", rights.image_is_small),
    ("no tools in it", rights.image_has_no_tools),
    ("rights", rights.rights_are_few),
    ("read-only root", rights.root_is_read_only),
    ("limits", rights.use_is_limited),
    ("networks", rights.networks_are_few),
    ("the page", rights.page_asks_for_its_token),
    ("a laptop's container", drives.laptop_comes_in),
    ("settings for zenohd", drives.settings_of_the_router_are_made),
    ("cost of a health check", drives.health_is_cheap),
    ("bridge process killed", partial(crashes.is_killed_alone, "services.bridge.child")),
    ("guard killed", partial(crashes.is_killed_alone, "services.bridge")),
    ("bridge container killed", partial(crashes.is_killed, "bridge")),
    ("safety container killed", partial(crashes.is_killed, "safety")),
    ("router container killed", partial(crashes.is_killed, "router")),
    ("odom container killed", partial(crashes.is_not_needed, "odom")),
    ("recorder container killed", partial(crashes.is_not_needed, "recorder")),
    ("dashboard container killed", partial(crashes.is_not_needed, "dashboard")),
    ("safety container paused", partial(crashes.is_frozen, "safety")),
    ("router container paused", partial(crashes.is_frozen, "router")),
    ("laptops' network cut", crashes.laptop_is_cut_off),
    ("odom hangs", crashes.hang_is_seen),
    ("odom upgraded, and back", upgrade.one_service_is_upgraded),
    ("logs", drives.logs_are_in_order),
)
KEPT = "test-kept"


def main(argv: Sequence[str] | None = None) -> int:
    """Look at everything; return 1 when something is not as it should be."""
    parser = argparse.ArgumentParser(prog="python -m verification.containers", description=__doc__)
    parser.add_argument("only", nargs="*", help="only what has these words in its name")
    parser.add_argument(
        "--keep-wheelhouse", action="store_true", help="take build/wheelhouse as it is"
    )
    parser.add_argument("--keep", action="store_true", help="leave the images for the next run")
    parser.add_argument("--built", action="store_true", help="with --keep: take what was left")
    options = parser.parse_args(argv)
    looks = [each for each in LOOKS if not options.only or any(o in each[0] for o in options.only)]
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
        with staged(Path(folder), image, tag, keep=options.keep, built=options.built) as stage:
            rows += [looked(stage, *each) for each in looks]
        if not options.keep:
            rows.append(nothing_is_left(tag))
    print(markdown(rows))
    return int(not all(row.fine for row in rows))


def looked(stage: Stage, what: str, look: Look) -> Row:
    """Look at one thing."""
    say(what)
    began_s = time.monotonic()
    try:
        seen, fine = look(stage), True
    except Exception as error:  # whatever it is, the next look is worth having
        seen, fine = f"{type(error).__name__}: {error}", False
    say(f"{'ok' if fine else 'WRONG'}: {seen}")
    stage.wheel.linear = 0.0
    return Row(what, seen, fine, time.monotonic() - began_s)


def nothing_is_left(tag: str) -> Row:
    """See that no container, volume, network or image of the project is left."""
    mine = f"name=t2-{tag}"
    left = [
        docker("ps", "--all", "--quiet", "--filter", mine),
        docker("volume", "ls", "--quiet", "--filter", mine),
        docker("network", "ls", "--quiet", "--filter", mine),
        docker("image", "ls", "--quiet", "--filter", f"reference=t2-*:{tag}*"),
    ]
    return Row("taken down", "; ".join(filter(None, left)) or "nothing is left", not any(left), 0.0)


if __name__ == "__main__":
    sys.exit(main())
