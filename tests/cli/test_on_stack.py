"""``t2 doctor`` and ``t2 checkout`` on one real stack; the simulator replaces the hand."""

import contextlib
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from sim.requests import Bumper, Sonar
from t2.messages import SONAR_NAMES
from tests.cli.inspect.tool import Tool
from tests.cli.processes import PATIENCE_S, sets, t2
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import wait_until

TRIES = 5  # safety stops on scheduling stalls; an operator tries again, too
PHRASE = "wheels off the ground"


class Operator:
    """The operator of a running checkout, whose output goes to a file."""

    def __init__(self, process: "subprocess.Popen[bytes]", output: Path) -> None:
        self.process = process
        self._output = output
        self._read = 0  # characters

    @property
    def shown(self) -> str:
        return self._output.read_text()

    def wait(self, *words: str) -> str:
        """Wait for one of these texts and return it; the output up to it counts as read."""

        def found() -> str:
            running, news = self.process.poll() is None, self.shown[self._read :]
            here = [word for word in words if word in news]
            assert running or here, self.shown
            return min(here, key=news.index, default="")

        first = wait_until(found, f"one of {words}", PATIENCE_S)
        self._read = self.shown.index(first, self._read) + len(first)
        return first

    def type(self, *lines: str) -> None:
        assert self.process.stdin is not None
        for line in lines:
            self.process.stdin.write(f"{line}\n".encode())


@contextlib.contextmanager
def checkout(stack: RunningStack, report: Path, *words: str) -> Iterator[Operator]:
    """Run a checkout and answer the questions before its first step."""
    command = t2("checkout", "--report", str(report), *sets(f"bus.connect={stack.endpoint}"))
    output = report.with_suffix(".log")
    with (
        output.open("wb") as file,
        subprocess.Popen(
            [*command, *words], stdin=subprocess.PIPE, stdout=file, stderr=file, bufsize=0
        ) as process,
    ):
        try:
            it = Operator(process, output)
            it.type("Ada", "")
            yield it
        finally:
            process.kill()


@pytest.fixture
def stack(tmp_path: Path) -> Iterator[RunningStack]:
    with running_stack(tmp_path) as it:
        yield it


def passes(it: Operator) -> bool:
    """Read a verdict; wait for the prompt after a failed one. A latch of a failed try is reset."""
    confirm = 'Type "reset"'
    found = it.wait("passed:", "failed:", confirm)
    if found == confirm:
        it.type("reset")
        found = it.wait("passed:", "failed:")
    if found == "passed:":
        return True
    it.wait("Press Enter to try again")
    return False


def tries(it: Operator, title: str) -> Iterator[None]:
    """Begin a step and yield for each try; one of them must pass."""
    it.wait(f"] {title}\n")
    it.wait("Press Enter to begin")
    it.type("")
    for _ in range(TRIES):
        yield
        if passes(it):
            return
        it.type("")
    raise AssertionError(it.shown)


def confirm(it: Operator) -> None:
    """Confirm a motion; on a busy host a repeated emergency stop may arrive after its reset."""
    if it.wait(f'Type "{PHRASE}"', 'Type "reset"') == 'Type "reset"':
        it.type("reset")
        it.wait(f'Type "{PHRASE}"')
    it.type(PHRASE)


def hold_a_hand(stack: RunningStack, it: Operator) -> None:
    for name in SONAR_NAMES:
        it.wait(f"NOW the {name.replace('_', ' ')} sonar")
        stack.control.do(Sonar(name=name, range=0.3))  # type: ignore[arg-type]
        it.wait("Take the hand away")
        stack.control.do(Sonar(name=name))  # type: ignore[arg-type]


def test_a_healthy_robot_and_a_complete_checkout(
    stack: RunningStack, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tool = Tool(stack.endpoint, "001", capsys)

    def wrong() -> set[str]:
        lines = tool("doctor", "--duration", "1").lines
        return {each["text"] for each in lines if each["level"] == "wrong"}

    wait_until(lambda: not wrong(), "a healthy robot", PATIENCE_S)
    report = tmp_path / "report.md"
    with checkout(stack, report) as it:
        for _ in tries(it, "Link"):
            pass
        for _ in tries(it, "Sonars"):
            hold_a_hand(stack, it)
        for _ in tries(it, "Bumper"):
            it.wait("NOW press the bumper")
            stack.control.do(Bumper(pressed=True))
            it.wait("NOW let go")
            assert "The bumper was hit. (brake, latched)" in wrong()
            stack.control.do(Bumper(pressed=False))
        for _ in tries(it, "Emergency stop"):
            pass
        for title in ("Forward", "Turn"):
            for _ in tries(it, title):
                confirm(it)
        it.wait("To sign this off")
        it.type("Ada")
        assert it.process.wait(PATIENCE_S) == 0, it.shown
    text = report.read_text(encoding="utf-8")
    assert "**Passed.**" in text
    assert text.count(" passed |") == 6
    assert "| counted / commanded |" in text
    assert "| wire.command_angular_unit | decidegree | default |" in text
    assert "T2 of bridge" in text
    assert text.rstrip().splitlines()[-3].startswith("Ada, ")  # the last line is the record
    wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")


def test_ctrl_c_stops_the_wheels_after_an_earlier_latch(
    stack: RunningStack, tmp_path: Path
) -> None:
    stack.control.do(Bumper(pressed=True))
    wait_until(lambda: '"cause": "contact"' in stack.log.read_text(), "safety's latch")
    stack.control.do(Bumper(pressed=False))
    report = tmp_path / "report.md"
    steps = [word for name in ("estop", "forward", "turn") for word in ("--only", name)]
    with checkout(stack, report, *steps) as it:
        it.wait("Press Enter to begin")
        it.type("nobody | near the switch")
        it.wait("Press Enter to begin")
        it.type("")
        it.wait("Safety has latched before: contact.")
        it.type("no")
        it.wait("failed: The earlier latch of safety was not reset.")
        it.wait("Press Enter to try again")
        it.type("")
        for _ in range(TRIES):
            it.wait('Type "reset"')
            it.type("reset")
            if it.wait(f'Type "{PHRASE}"', "Press Enter to try again").endswith(f'{PHRASE}"'):
                break
            it.type("")
        it.type(PHRASE)
        wait_until(lambda: abs(stack.speed()) > 0.02, "the wheels turn")
        it.process.send_signal(signal.SIGINT)
        assert it.process.wait(PATIENCE_S) == 1
        wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")
        wait_until(lambda: stack.last() in ("stop", "brake"), "STOP at the board")
    text = report.read_text(encoding="utf-8")
    assert "Ended early: interrupted by the operator." in text
    assert "| Emergency stop | skipped | nobody \\| near the switch |" in text
    assert "Not signed." in text
