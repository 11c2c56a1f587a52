"""The image to build on: the official one where a registry gives it, else of Debian's packages."""

import os
import shutil

from verification.containers.engine import EngineError, docker, pulled, ran
from verification.containers.stack_fixture import ROOT, say

OFFICIAL = "python:3.13-slim"
OWN = "t2-base:bookworm"  # stays on the machine: it takes minutes to make
MAKING_S = 1800.0


def wheelhouse(image: str) -> None:
    """Make the wheelhouse anew, for the Python of an image: T2 itself is in it."""
    say("making the wheelhouse")
    version = "import sys; print('{}.{}'.format(*sys.version_info))"
    python = docker("run", "--rm", "--entrypoint", "python3", image, "-c", version)
    make = ["make", "-C", str(ROOT), "wheelhouse", "SET=laptop", f"WHEEL_PYTHON={python}"]
    ran(make, None, MAKING_S)


def base() -> str:
    """Return an image to build on; ``T2_BASE`` names another."""
    named = os.environ.get("T2_BASE")
    if named:
        return named
    if docker("image", "ls", "--quiet", OWN):
        return OWN
    if pulled(OFFICIAL):
        return OFFICIAL
    if shutil.which("debootstrap") is None or os.geteuid() != 0:
        raise EngineError("no registry gives a base image; to make one takes root and debootstrap")
    say("making a base image of Debian's packages")
    ran(["sh", str(ROOT / "deploy/image/base.sh"), OWN], None, MAKING_S)
    return OWN
