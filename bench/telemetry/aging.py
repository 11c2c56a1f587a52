"""``python -m bench.telemetry.aging FILE COUNT``: safety, which notes what it decides on.

Nothing else differs. For so many decisions, after some to warm up, it notes how long ago the
bridge stamped the samples (ns), and then writes them into the file.
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


class Notes:
    """What was noted so far."""

    def __init__(self, file: Path, count: int) -> None:
        self._file = file
        self._count = count
        self._ages_ns: list[list[int]] = []

    def take(self, inputs: Inputs, now_ns: int) -> None:
        """Note one decision; write all of them when it was the last."""
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
    """Be safety until killed."""
    notes = Notes(file, count)

    def decide(policy: Policy, state: State, inputs: Inputs, now_ns: int) -> tuple[State, Verdict]:
        notes.take(inputs, now_ns)
        return DECIDE(policy, state, inputs, now_ns)

    with patch.object(Policy, "decide", decide):
        return main(sys.argv[3:])


if __name__ == "__main__":
    sys.exit(run(Path(sys.argv[1]), int(sys.argv[2])))
