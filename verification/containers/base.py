"""The base image: the official one from a registry, else built from Debian packages."""

import os
import shutil

from verification.containers.engine import EngineError, docker, pulled, ran
from verification.containers.stack_fixture import ROOT, progress

OFFICIAL = "python:3.13-slim"
OWN = "t2-base:bookworm"  # kept on the machine: building takes minutes
BUILD_S = 1800.0


def wheelhouse(image: str) -> None:
    """Build the wheelhouse, with T2, for the Python of an image."""
    progress("building the wheelhouse")
    version = "import sys; print('{}.{}'.format(*sys.version_info))"
    python = docker("run", "--rm", "--entrypoint", "python3", image, "-c", version)
    make = ["make", "-C", str(ROOT), "wheelhouse", "SET=laptop", f"WHEEL_PYTHON={python}"]
    ran(make, None, BUILD_S)


def base() -> str:
    """Return the base image; ``T2_BASE`` overrides it."""
    named = os.environ.get("T2_BASE")
    if named:
        return named
    if docker("image", "ls", "--quiet", OWN):
        return OWN
    if pulled(OFFICIAL):
        return OFFICIAL
    if shutil.which("debootstrap") is None or os.geteuid() != 0:
        raise EngineError("no registry has the base image; building one needs root and debootstrap")
    progress("building a base image from Debian packages")
    ran(["sh", str(ROOT / "deploy/image/base.sh"), OWN], None, BUILD_S)
    return OWN
