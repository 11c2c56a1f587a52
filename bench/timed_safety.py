"""``python -m bench.timed_safety FILE ...``: safety, which writes the duration of each decision.

FILE has them in ns at the end. Nothing else differs.
"""

import sys
import time
from pathlib import Path
from unittest.mock import patch

from services.safety.__main__ import main
from services.safety.core.inputs import Inputs
from services.safety.core.policy import Decision, Policy
from services.safety.core.state import State

decide = Policy.decide
durations: list[int] = []


def timed(policy: Policy, state: State, inputs: Inputs, now_ns: int) -> Decision:
    """Decide, and note the duration."""
    begin_ns = time.perf_counter_ns()
    decision = decide(policy, state, inputs, now_ns)
    durations.append(time.perf_counter_ns() - begin_ns)
    return decision


if __name__ == "__main__":
    file, *arguments = sys.argv[1:]
    with patch.object(Policy, "decide", timed):
        code = main(arguments)
    Path(file).write_text("\n".join(map(str, durations)), encoding="ascii")
    sys.exit(code)
