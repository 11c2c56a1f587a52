"""The Rust programs of examples/rust: compiled, and driven on the real stack."""

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.docs.integrator import (
    ROOT,
    Integrator,
    check_driving,
    check_limiting,
    check_reading,
    check_silent_safety,
    running_integrator,
)
from tests.docs.secured import secured_integrator

PROJECT = ROOT / "examples" / "rust"
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "out" / "rust"))
COMPILE_S = 310.0  # 104 to 192 s from nothing on two cores; pytest ends the process at 330
CARGO = shutil.which("cargo")
# What cargo prints when the index of crates or a crate cannot be reached.
OFFLINE = re.compile(r"resolve host|connect to server|download of|failed to download|timed out")

needs_cargo = pytest.mark.skipif(CARGO is None, reason="cargo is not installed")
campaign = pytest.mark.campaign


def test_the_crate_has_the_version_of_the_stack() -> None:
    (locked,) = re.findall(
        r"^eclipse-zenoh==(\S+)", (ROOT / "requirements.lock").read_text(encoding="utf-8"), re.M
    )
    manifest = (PROJECT / "Cargo.toml").read_text(encoding="utf-8")
    assert re.findall(r'^zenoh = \{ version = "=([^"]+)"', manifest, re.M) == [locked]


def cargo(*words: str) -> "subprocess.CompletedProcess[str]":
    """Run cargo in the project, at a low priority: other tests measure times meanwhile."""
    assert CARGO is not None
    return subprocess.run(
        ["nice", "-n", "10", CARGO, *words],
        cwd=PROJECT, env={**os.environ, "CARGO_TARGET_DIR": str(TARGET)},
        capture_output=True, text=True, timeout=COMPILE_S, check=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def programs() -> Path:
    """Compile the programs; return their folder."""
    fetched = cargo("fetch")
    if fetched.returncode != 0 and OFFLINE.search(fetched.stderr):
        pytest.skip(f"the crates cannot be downloaded: {fetched.stderr[-300:]}")
    try:
        built = cargo("build")
    except subprocess.TimeoutExpired:
        pytest.skip(f"not compiled within {COMPILE_S:.0f} s; run `make rust-example`")
    assert built.returncode == 0, fetched.stderr + built.stderr
    assert "warning" not in built.stderr, built.stderr
    return TARGET / "debug"


@pytest.fixture(scope="module")
def it(programs: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Integrator]:
    with running_integrator(tmp_path_factory.mktemp("rust")) as it:
        yield it


@needs_cargo
def test_the_sources_are_formatted() -> None:
    formatted = cargo("fmt", "--check")
    if "no such command" in formatted.stderr or "not installed" in formatted.stderr:
        pytest.skip("rustfmt is not installed")
    assert formatted.returncode == 0, formatted.stdout


@needs_cargo
@campaign
@pytest.mark.timed
@pytest.mark.timeout(400)
def test_the_consumer(it: Integrator, programs: Path) -> None:
    check_reading(it, str(programs / "read"))


@needs_cargo
@campaign
@pytest.mark.timed
@pytest.mark.timeout(400)
def test_the_source(it: Integrator, programs: Path) -> None:
    check_driving(it, str(programs / "drive"))


@needs_cargo
@campaign
@pytest.mark.timed
@pytest.mark.timeout(400)
def test_the_source_ends_when_safety_dies(it: Integrator, programs: Path) -> None:
    check_silent_safety(it, str(programs / "drive"))


@needs_cargo
@campaign
@pytest.mark.timed
@pytest.mark.timeout(400)
def test_the_limit(it: Integrator, programs: Path) -> None:
    check_limiting(it, str(programs / "limit"))


@needs_cargo
@campaign
@pytest.mark.timed
@pytest.mark.timeout(400)
def test_a_source_without_its_limit(it: Integrator, programs: Path) -> None:
    unlimited = "safety does not obey patrol: No speed limit arrives of detector."
    it.check_failure(unlimited, str(programs / "drive"))


@needs_cargo
@campaign
@pytest.mark.timed
@pytest.mark.timeout(400)
def test_the_source_with_a_certificate(programs: Path, tmp_path: Path) -> None:
    with secured_integrator(tmp_path) as secured:
        check_driving(secured.integrator, str(programs / "drive"), router=secured.configuration())
