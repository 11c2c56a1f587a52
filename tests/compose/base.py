"""The image to build on: the official one where a registry gives it, else of Debian's packages."""

import os
import shutil

from tests.compose.engine import docker, pulled, ran
from tests.compose.stage import ROOT, say

OFFICIAL = "python:3.13-slim"
OWN = "t2-base:bookworm"  # stays on the machine: it takes minutes to make
MAKING_S = 1800.0


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
        raise AssertionError(
            "no registry gives an image to build on, and without root and debootstrap none is made"
        )
    say("making a base image of Debian's packages")
    ran(["sh", str(ROOT / "deploy/image/base.sh"), OWN], None, MAKING_S)
    return OWN
