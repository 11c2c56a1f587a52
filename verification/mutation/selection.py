"""Which files are cores, and which tests have to notice every change of them.

``[tool.mutants]`` of ``pyproject.toml`` names the cores. The tests of a core are those of its
folder below ``tests/`` that are shared by its cores, or import it, themselves or by a fixture. They
start no process: they reach neither Zenoh nor ``subprocess``.
"""

import subprocess
import tomllib
from pathlib import Path

import grimp

PACKAGES = "cli", "common", "services", "sim", "tests", "verification"
UNMIRRORED = {"services", "core"}  # folders that the tests do not repeat
WITH_PROCESSES = {"zenoh", "subprocess"}

Cores = dict[str, list[str]]  # tests of each file


def cores() -> Cores:
    """Return the cores of the current folder with their tests; ValueError for a wrong name."""
    settings = tomllib.loads(Path("pyproject.toml").read_text("utf-8"))["tool"]["mutants"]
    folders = settings["cores"]
    shared = {module_of(test) for glob in settings["shared"] for test in Path().glob(glob)}
    graph = grimp.build_graph(*PACKAGES, include_external_packages=True, cache_dir=None)
    imports = {
        test: _imports(graph, test)
        for test in sorted(graph.modules)
        if test.rpartition(".")[2].startswith("test_")
        and not graph.find_upstream_modules(test) & WITH_PROCESSES
    }
    found: Cores = {}
    for pattern in (f"{folder}/{name}.py" for folder, names in folders.items() for name in names):
        paths = [path for path in sorted(Path().glob(pattern)) if not path.stem.startswith("_")]
        if not paths and "*" not in pattern:
            raise ValueError(f"pyproject.toml: tool.mutants: {pattern} does not exist")
        for path in paths:
            if "def " not in path.read_text("utf-8"):
                continue  # data only: nothing to mutate
            core = module_of(path)
            folder = ".".join(
                ["tests", *(it for it in path.parts[:-1] if it not in UNMIRRORED), ""]
            )
            found[str(path)] = [
                f"{test.replace('.', '/')}.py"
                for test, imported in imports.items()
                if test.startswith(folder) and (core in imported or test in shared)
            ]
            if not found[str(path)]:
                raise ValueError(f"{path}: no test imports it")
    return found


def _imports(graph: grimp.ImportGraph, test: str) -> set[str]:
    """Return what a test imports, itself or through the fixtures of its folder."""
    near = {each for each in graph.find_upstream_modules(test) if each.startswith("tests.")}
    return {one for each in near | {test} for one in graph.find_modules_directly_imported_by(each)}


def module_of(path: Path) -> str:
    """Return the module of a file."""
    return ".".join(path.with_suffix("").parts)


def changed(cores: Cores) -> Cores:
    """Return the cores that differ from the fork point of the branch, committed or not.

    On main they are compared with the previous commit.
    """
    head, fork = _git("rev-parse", "HEAD"), _git("merge-base", "origin/main", "HEAD")
    commit = fork if fork and fork != head else _git("rev-parse", "--verify", "HEAD~1")
    diff = None if commit is None else _git("diff", "--name-only", "--relative", commit)
    if commit is None or diff is None:
        print("mutants: skipped, no commit to compare with; `make mutants` tests all cores")
        return {}
    chosen = {file: tests for file, tests in cores.items() if file in diff.splitlines()}
    print(f"mutants: since {commit[:7]}: {', '.join(chosen) or 'no core changed'}", flush=True)
    return chosen


def _git(*words: str) -> str | None:
    """Return the output of git; None when it fails or is missing."""
    try:
        done = subprocess.run(["git", *words], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()
