"""``python -m verification.fuzz``: coverage-guided fuzzing of each target.

Each target runs in its own process, because libFuzzer ends its process. A finding is written to
``out/fuzz``; after the fix it belongs into ``verification/fuzz/corpus``.
"""

import argparse
import platform
import re
import subprocess
import sys
from pathlib import Path
from random import Random

OUT = Path("out") / "fuzz"
INSTRUMENTED = ["common", "tomllib", "cli", "services", "sim"]  # before they are imported
TARGETS = ("frames", "messages", "toml", "environ", "sets")
LONGEST = 4096  # bytes of an input: longer than all datagrams and messages


def main() -> int:
    """Fuzz one target or all; return 0 without a finding."""
    parser = argparse.ArgumentParser(prog="python -m verification.fuzz", description=__doc__)
    parser.add_argument("--seconds", type=int, default=60, help="duration of each target, 60")
    parser.add_argument("target", nargs="?", choices=TARGETS, help="default: all")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.here:
        fuzz(options.target, options.seconds)
    try:
        import atheris  # noqa: F401
    except ImportError:
        print(absent(), file=sys.stderr)
        return 69
    targets = [options.target] if options.target else TARGETS
    return max([run(target, options.seconds) for target in targets])


def absent() -> str:
    """Return why fuzzing is not available."""
    return (
        f"atheris is not installed, and this is Python {platform.python_version()} on "
        f"{platform.system()} {platform.machine()}. Its wheels are for Linux on x86_64, Python "
        "3.11 to 3.14: `make fuzz` needs one of these. `make test` replays the corpus anywhere."
    )


def run(target: str, seconds: int) -> int:
    """Fuzz a target in its own process and print a summary; return 1 for a finding."""
    (OUT / target).mkdir(parents=True, exist_ok=True)
    log = OUT / target / "log.txt"
    command = [sys.executable, "-m", "verification.fuzz", target, f"--seconds={seconds}", "--here"]
    with log.open("wb") as output:
        code = subprocess.run(command, stdout=output, stderr=output, check=False).returncode
    text = log.read_text(errors="replace")
    executed = re.search(r"number_of_executed_units: *(\d+)", text)
    reached = re.findall(r"cov: (\d+) ft: \d+ corp: (\d+)", text)
    summary = f"{int(executed[1]):>9} executions" if executed else "no statistics"
    more = f", {reached[-1][0]} points reached by {reached[-1][1]} inputs" if reached else ""
    print(f"{target:9}{summary}{more}: {'nothing found' if code == 0 else f'FOUND, see {log}'}")
    return min(code, 1) if code >= 0 else 1


def fuzz(target: str, seconds: int) -> None:
    """Fuzz in this process, which libFuzzer ends."""
    import atheris

    with atheris.instrument_imports(include=INSTRUMENTED):
        from verification.fuzz import mutation, seeds, targets
    begin, kept = OUT / target / "seeds", OUT / target / "kept"
    for folder in (begin, kept):
        folder.mkdir(parents=True, exist_ok=True)
    raws = list(seeds.seeds(target))
    for number, raw in enumerate(raws):
        (begin / f"{number:03}").write_bytes(raw)
    known = [str(seeds.CORPUS / target)] if (seeds.CORPUS / target).exists() else []
    words = [f"-max_total_time={seconds}", f"-max_len={LONGEST}", "-print_final_stats=1",
             "-timeout=20", f"-artifact_prefix={OUT / target}/", str(kept), str(begin)]  # fmt: skip

    def mutate(raw: bytes, max_size: int, seed: int) -> bytes:
        random = Random(seed)
        if random.random() < 0.5:
            raw = mutation.mutated(raws, random)[:max_size]
        damaged: bytes = atheris.Mutate(raw, max_size) if random.random() < 0.5 else raw
        return damaged

    more = {"custom_mutator": mutate} if target == "messages" else {}
    atheris.Setup([sys.argv[0], *words, *known], targets.TARGETS[target], **more)
    atheris.Fuzz()


if __name__ == "__main__":
    sys.exit(main())
