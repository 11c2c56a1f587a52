"""``python -m verification.fuzz``: coverage-guided fuzzing of each target.

Each target runs in its own process, because libFuzzer ends its process. A finding is written to
``out/fuzz``; after the fix it belongs into ``verification/fuzz/corpus``.
"""

import argparse
import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from random import Random

OUT = Path("out") / "fuzz"
INSTRUMENTED = ["common", "tomllib", "cli", "services", "sim"]  # before they are imported
TARGETS = ("frames", "messages", "toml", "environ", "sets")
LONGEST = 4096  # bytes of an input: longer than all datagrams and messages
ABSENT = (
    "atheris is not installed. Its wheels are for Linux on x86_64, Python 3.11 to 3.14. "
    "`make test` replays the corpus anywhere."
)


def main() -> int:
    """Fuzz one target in this process, or each in its own; return 0 without a finding."""
    parser = argparse.ArgumentParser(prog="python -m verification.fuzz", description=__doc__)
    parser.add_argument("--seconds", type=int, default=60, help="duration of each target, 60")
    parser.add_argument("target", nargs="?", choices=TARGETS, help="default: all")
    options = parser.parse_args()
    if importlib.util.find_spec("atheris") is None:
        print(ABSENT, file=sys.stderr)
        return 69
    if options.target:
        fuzz(options.target, options.seconds)
    return max([run(target, options.seconds) for target in TARGETS])


def run(target: str, seconds: int) -> int:
    """Fuzz a target in its own process and print a summary; return 1 for a finding."""
    OUT.mkdir(parents=True, exist_ok=True)
    log = OUT / f"{target}.log"
    command = [sys.executable, "-m", "verification.fuzz", target, f"--seconds={seconds}"]
    with log.open("wb") as output:
        code = subprocess.run(command, stdout=output, stderr=output, check=False).returncode
    executed = re.search(r"number_of_executed_units: *(\d+)", log.read_text(errors="replace"))
    result = f"FOUND, see {log}" if code else "nothing found"
    print(f"{target:9}{executed[1] if executed else 'no':>9} executions: {result}", flush=True)
    return int(code != 0)


def fuzz(target: str, seconds: int) -> None:
    """Fuzz in this process, which libFuzzer ends."""
    import atheris

    with atheris.instrument_imports(include=INSTRUMENTED):
        from verification.fuzz import seeds, targets
    raws = list(seeds.seeds(target))
    inputs = OUT / target / "inputs"  # libFuzzer adds those with new coverage
    inputs.mkdir(parents=True, exist_ok=True)
    for number, raw in enumerate(raws):
        (inputs / f"{number:03}").write_bytes(raw)
    words = [f"-max_total_time={seconds}", f"-max_len={LONGEST}", "-print_final_stats=1",
             "-timeout=20", f"-artifact_prefix={OUT / target}/"]  # fmt: skip
    folders = [str(it) for it in (inputs, seeds.CORPUS / target) if it.exists()]

    def mutate(raw: bytes, max_size: int, seed: int) -> bytes:
        random = Random(seed)
        if random.random() < 0.5:
            return seeds.mutated(raws, random)[:max_size]
        damaged: bytes = atheris.Mutate(raw, max_size)
        return damaged

    # msgspec decodes in C, where libFuzzer has no coverage: alone it keeps two inputs only.
    more = {"custom_mutator": mutate} if target == "messages" else {}
    atheris.Setup([sys.argv[0], *words, *folders], targets.TARGETS[target], **more)
    atheris.Fuzz()


if __name__ == "__main__":
    sys.exit(main())
