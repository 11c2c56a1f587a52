import subprocess
import sys

import pytest

from common import realtime
from common.cli_args import EXIT_CONFIG
from sim.__main__ import main
from tests.common.rights import needs_right
from verification.harness.bus import set_options
from verification.harness.ports import udp_ports
from verification.harness.waiting import wait_until


@needs_right
def test_nobody_on_board_keeps_it_waiting() -> None:
    board, *listen = udp_ports(3)
    sets = f"board.port={board}", f"board.listen_ports={listen}", "host.realtime=true"
    command = [sys.executable, "-m", "sim", *set_options(*sets)]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as running:
        try:
            wait_until(lambda: realtime.priority(running.pid) == realtime.BOARD, "the priority")
        finally:
            running.kill()


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--world", "moon"], "sim.world = 'moon'"),
        (["--trace", "nowhere/trace.jsonl"], "--trace nowhere/trace.jsonl: cannot be written"),
    ],
)
def test_bad_settings_end_it_with_what_is_wrong(
    words: list[str], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    # This process would keep the priority.
    assert main([*words, "--set", "host.realtime=false"]) == EXIT_CONFIG
    assert named in capsys.readouterr().err


def test_the_profiles_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--list-profiles"]) == 0
    assert "short-sonar " in capsys.readouterr().out
