"""The whole walk against the real stack; the simulator's requests play the operator's hand."""

import re
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from common.cli_args import EXIT_LINK
from common.errors import LinkError
from common.messages import SONAR_NAMES
from sim.requests import Bumper, Sonar
from tests.cli.commission.operator_process import Seat, seat
from tests.cli.processes import ran
from verification.harness.stack import Chain, chain
from verification.harness.support import free_port, wait_until

TRIES = 5  # a machine that is held up makes safety stop; an operator would try again, too
BLOCKS = "wheels off the ground"


@pytest.fixture
def stack(tmp_path: Path) -> Iterator[Chain]:
    with chain(tmp_path) as it:
        yield it


def at(stack: Chain) -> list[str]:
    return ["--set", f"bus.connect={stack.endpoint}"]


def answers(stack: Chain) -> bool:
    """Tell whether the simulator takes requests."""
    try:
        stack.control.truth()
    except LinkError:
        return False
    return True


def passes(it: Seat) -> bool:
    """Read a verdict; go on from a failed one to the next try."""
    if it.wait("passed:", "failed:") == "passed:":
        return True
    it.wait("Enter tries again")
    return False


def tries(it: Seat, title: str) -> Iterator[None]:
    """Begin a step and yield for each try of it; the last one must pass."""
    it.wait(f"] {title}\n", f"] {title}\r\n")
    it.wait("Enter begins")
    it.type("")
    for _ in range(TRIES):
        yield
        if passes(it):
            return
        it.type("")
    raise AssertionError(it.shown)


def hold_a_hand(stack: Chain, it: Seat) -> None:
    for name in SONAR_NAMES:
        it.wait(f"NOW the {name.replace('_', ' ')} sonar")
        stack.control.do(Sonar(name=name, range=0.3))  # type: ignore[arg-type]
        it.wait("Take the hand away")
        stack.control.do(Sonar(name=name))  # type: ignore[arg-type]


def test_from_the_first_question_to_the_signature(stack: Chain, tmp_path: Path) -> None:
    report = tmp_path / "out" / "report.md"
    with seat(report, *at(stack)) as it:
        it.begin()
        for title in ("Link", "CRC"):
            for _ in tries(it, title):
                pass
        for _ in tries(it, "Sonars"):
            hold_a_hand(stack, it)
        for _ in tries(it, "Bumper"):
            it.wait("NOW press the bumper")
            stack.control.do(Bumper(pressed=True))
            it.wait("NOW let go")
            stack.control.do(Bumper(pressed=False))
        for _ in tries(it, "Emergency stop"):
            pass
        for title in ("Forward", "Turn"):
            for _ in tries(it, title):
                it.wait(f'Type "{BLOCKS}"')
                it.type(BLOCKS)
        assert it.sign() == 0, it.shown
    text = report.read_text(encoding="utf-8")
    assert "**Passed.**" in text
    assert text.count(" passed |") == 7
    assert "| counted by commanded |" in text
    assert "| wire.command_angular_unit | decidegree | config/t2.toml |" in text
    assert "T2 of bridge" in text
    assert text.rstrip().splitlines()[-1].startswith("Ada, ")
    wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")


def test_a_firmware_with_another_unit_and_a_dead_sonar_are_named(
    stack: Chain, tmp_path: Path
) -> None:
    stack.kill("sim")
    for way in ("command", "feedback"):
        stack.commands["sim"] += ["--set", f"wire.{way}_angular_unit=milliradian"]
    stack.start("sim")
    wait_until(lambda: answers(stack), "the simulator's control socket")
    stack.control.do(Sonar(name="rear", fault=True))
    report = tmp_path / "report.md"
    with seat(report, *at(stack), "--only", "sonar", "--only", "turn") as it:
        it.begin()
        it.wait("] Sonars")
        it.type("")
        for name in SONAR_NAMES:
            if name == "rear":
                it.wait("The rear sonar is faulty.")
                continue
            # left and right are exchanged, as far as a hand can tell
            other = name.replace("left", "?").replace("right", "left").replace("?", "right")
            it.wait(f"NOW the {name.replace('_', ' ')} sonar")
            stack.control.do(Sonar(name=other, range=0.3))  # type: ignore[arg-type]
            it.wait("Take the hand away")
            stack.control.do(Sonar(name=other))  # type: ignore[arg-type]
        it.wait("failed:")
        it.wait("Left and right are exchanged")
        it.wait("any word goes on")
        it.type("on")
        it.wait("] Turn")
        it.type("")
        for _ in range(TRIES):
            if it.wait(f'Type "{BLOCKS}"', 'Type "reset"') == 'Type "reset"':
                it.type("reset")  # it was held up so often that safety latched
                it.wait(f'Type "{BLOCKS}"')
            it.type(BLOCKS)
            it.wait("failed:")
            if it.wait("wire.command_angular_unit = ", "not let through", "does not let") == (
                "wire.command_angular_unit = "
            ):
                break
            it.wait("Enter tries again")
            it.type("")
        it.wait("any word goes on")
        it.type("on")
        assert it.sign() == 1
    text = report.read_text(encoding="utf-8")
    assert "**Not passed.** Only a part: link, crc, bumper, estop, forward were not" in text
    assert "rear is faulty: the board reports 0xFFFF." in text
    ratio = re.search(r"counted by commanded \| ([0-9.]+) ", text)
    assert ratio is not None
    assert float(ratio[1]) == pytest.approx(0.573, rel=0.15)  # 1 mrad in units of 0.1 deg
    assert 'wire.command_angular_unit = "milliradian".' in text


def test_ctrl_c_while_the_wheels_turn_stops_them(stack: Chain, tmp_path: Path) -> None:
    report = tmp_path / "report.md"
    with seat(report, *at(stack), "--only", "estop", "--only", "forward") as it:
        it.begin()
        it.wait("Enter begins")
        it.type("nobody | near the switch")
        it.wait("Enter begins")
        it.type("")
        it.wait(f'Type "{BLOCKS}"')
        it.type(BLOCKS)
        wait_until(lambda: abs(stack.speed()) > 0.02, "the wheels turn")
        it.signal(signal.SIGINT)
        assert it.end() == 1
        wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")
        wait_until(lambda: stack.last() in ("stop", "brake"), "STOP at the board")
    text = report.read_text(encoding="utf-8")
    assert "Ended early: interrupted by the operator." in text
    assert "| Emergency stop | skipped | nobody \\| near the switch |" in text
    assert "Nobody has signed." in text


def test_a_latch_from_before_is_reset_on_the_operator_s_word(stack: Chain, tmp_path: Path) -> None:
    stack.control.do(Bumper(pressed=True))
    # The board is told BREAK at a bridge's start, too; only safety's word is of this hit.
    wait_until(lambda: '"cause": "contact"' in stack.log.read_text(), "safety's latch")
    stack.control.do(Bumper(pressed=False))
    with seat(tmp_path / "report.md", *at(stack), "--only", "estop") as it:
        it.begin()
        it.wait("Enter begins")
        it.type("")
        it.wait("Safety holds, from before: contact.")
        it.type("no")
        it.wait("failed: What safety held from before was not reset.")
        for _ in range(TRIES):
            it.wait("Enter tries again")
            it.type("")
            if it.wait('Type "reset"', "passed:") == "passed:":
                break
            it.type("reset")
            if it.wait("passed:", "failed:") == "passed:":
                break
        assert it.sign("Eve") == 1  # not the name that was given at the start


def test_without_a_stack_there_is_nothing_to_check(tmp_path: Path) -> None:
    report = tmp_path / "report.md"
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    result = ran("checkout", "--set", f"bus.connect={endpoint}", "--report", str(report))
    assert result.returncode == EXIT_LINK
    assert f"heard on {endpoint}" in result.stderr
    assert "t2 up --no-sim" in result.stderr
    assert not report.exists()
