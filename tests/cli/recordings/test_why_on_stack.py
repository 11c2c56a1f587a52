"""``t2 why`` on a recording of the real processes."""

import re
import sys
import time
from pathlib import Path

import pytest

from cli.__main__ import main
from cli.settings import Everything
from common.loop import Loop
from sim.requests import Bumper
from tests.drive_source import ConstantSource, drive_until_moving
from verification.harness.bus import bus_on, running, set_options
from verification.harness.stack import running_stack

AGREEING = 0.99  # of the motions
ATTEMPTS = 3  # a recording of a host that stalled lacks messages


def record_contact(folder: Path) -> Path:
    """Drive into a press of the bumper; return the recording."""
    recordings = folder / "recordings"

    def recorder(config: Everything) -> dict[str, list[str]]:
        sets = (f"bus.connect={config.bus.endpoints[0]}", f"recorder.folder={recordings}",
                "recorder.everything=true")  # fmt: skip
        return {"recorder": [sys.executable, "-m", "services.recorder", *set_options(*sets)]}

    with running_stack(folder, beside=recorder) as stack, running(Loop()) as loop:
        source = ConstantSource(loop)
        with bus_on(stack.endpoint, loop, source.declare):
            time.sleep(2.0)
            drive_until_moving(stack, source)
            stack.control.do(Bumper(pressed=True))
            time.sleep(0.5)
            stack.control.do(Bumper(pressed=False))
            time.sleep(1.0)
        stack.processes["recorder"].terminate()
        stack.processes["recorder"].wait(10)
    (file,) = (each for each in recordings.glob("*.mcap") if "latch" not in each.name)
    return file


def verified(shown: str) -> bool:
    """Return whether the motions came out again, and with them the stop by the contact."""
    found = re.search(r"replay: (\d+) of (\d+) motions agree", shown)
    assert found, shown
    _, contact, after = shown.partition("BRAKE  contact: The bumper was hit.")
    assert contact, shown
    agree = int(found[1]) >= AGREEING * int(found[2]) > 50
    return agree and "not verified" not in after.partition("\n\n")[0]


@pytest.mark.timed
def test_the_motions_of_a_real_stack_come_out_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shown = ""
    for attempt in range(ATTEMPTS):
        folder = tmp_path / str(attempt)
        folder.mkdir()
        main(["why", str(record_contact(folder))])
        shown = capsys.readouterr().out
        assert "\nsettings: those of safety in the recording\n" in shown
        if verified(shown):
            return
    raise AssertionError(shown)
