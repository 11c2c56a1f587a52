"""The way from a contact to BRAKE stays short (``docs/architecture.md``)."""

import subprocess
import sys

PROGRAM = """
from verification.cost import stop_path
for way in (stop_path.reflex(), stop_path.judged()):
    print(len(way), len({file for file, _ in way}))
"""


def test_few_functions_lie_between_a_contact_and_brake() -> None:
    # In a process of its own: the replay replaces the clocks.
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True
    )
    reflex, judged = (tuple(map(int, line.split())) for line in run.stdout.splitlines())
    assert reflex[0] <= 8
    assert reflex[1] <= 4
    assert judged[0] <= 40
