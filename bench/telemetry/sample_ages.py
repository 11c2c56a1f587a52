"""``python -m bench.telemetry.sample_ages FILE COUNT``: safety with a record of sample ages.

For COUNT decisions, after a warm-up, it records how long before the bridge stamped each newest
sample (ns), and then writes the record to FILE. Safety is otherwise unchanged.
"""

import sys
from pathlib import Path
from unittest.mock import patch

import msgspec

from services.safety.__main__ import main
from services.safety.inputs import Inputs
from services.safety.policy import Policy
from services.safety.state import State, Verdict

STREAMS = ("velocity", "ultrasonic", "bumper")
WARM = 200  # decisions
DECIDE = Policy.decide


class Ages:
    """Ages recorded so far."""

    def __init__(self, file: Path, count: int) -> None:
        self._file = file
        self._count = count
        self._ages_ns: list[list[int]] = []

    def take(self, inputs: Inputs, now_ns: int) -> None:
        """Record one decision; write the file after the last one."""
        latest = [getattr(inputs, name) for name in STREAMS]
        if None in latest:
            return
        self._ages_ns.append([now_ns - each.value.mono_ns for each in latest])
        if len(self._ages_ns) == WARM + self._count:
            streams = zip(STREAMS, zip(*self._ages_ns[WARM:], strict=True), strict=True)
            part = self._file.with_suffix(".part")
            part.write_bytes(msgspec.json.encode(dict(streams)))
            part.replace(self._file)


def run(file: Path, count: int) -> int:
    """Run safety until killed."""
    ages = Ages(file, count)

    def decide(policy: Policy, state: State, inputs: Inputs, now_ns: int) -> tuple[State, Verdict]:
        ages.take(inputs, now_ns)
        return DECIDE(policy, state, inputs, now_ns)

    with patch.object(Policy, "decide", decide):
        return main(sys.argv[3:])


if __name__ == "__main__":
    sys.exit(run(Path(sys.argv[1]), int(sys.argv[2])))
