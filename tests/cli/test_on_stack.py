"""``t2 doctor`` and ``t2 checkout`` on one real stack; the simulator replaces the hand."""

import contextlib
import signal
import subprocess
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from cli.inspect.diagnosis import BUMPER
from common.cli_args import EXIT_LINK
from common.messages import SONAR_NAMES
from sim.requests import Bumper, Sonar
from tests.cli.inspect.tool import Tool
from tests.cli.processes import PATIENCE_S, ran, t2
from verification.harness.ports import free_port
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import wait_until

TRIES = 5  # safety stops on scheduling stalls; an operator tries again, too
PHRASE = "wheels off the ground"


class OperatorProcess:
    """Process of the checkout; ``wait`` reads its output from the last match on."""

    def __init__(self, words: Sequence[str]) -> None:
        self.process = subprocess.Popen(
            t2("checkout", *words),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            bufsize=0,
        )
        self.shown = ""
        self._read = 0
        self._thread = threading.Thread(target=self._take, daemon=True)
        self._thread.start()

    def wait(self, *words: str) -> str:
        """Wait for one of these texts and return it; the output up to it counts as read."""

        def found() -> bool:
            assert self.process.poll() is None or any(w in self._news() for w in words), self.shown
            return any(word in self._news() for word in words)

        try:
            wait_until(found, f"one of {words}", PATIENCE_S)
        except AssertionError as error:
            raise AssertionError(f"{error}; its output:\n{self.shown}") from None
        news = self._news()
        first = min((w for w in words if w in news), key=news.index)
        self._read += news.index(first) + len(first)
        return first

    def type(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n".encode())

    def signal(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    def begin(self, name: str = "Ada") -> None:
        """Answer the questions before the first step."""
        self.wait("Your name:")
        self.type(name)
        self.wait("The firmware")
        self.type("")

    def sign(self, name: str = "Ada") -> int:
        """Sign, and return the exit code."""
        self.wait("To sign this off")
        self.type(name)
        return self.end()

    def end(self) -> int:
        """Wait for the end, and return the exit code."""
        code = self.process.wait(PATIENCE_S)
        self._thread.join(PATIENCE_S)
        return code

    def kill(self) -> None:
        """Kill it, in any state."""
        self.process.kill()
        self.process.wait()
        self._thread.join(PATIENCE_S)
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe is not None
            pipe.close()

    def _news(self) -> str:
        return self.shown[self._read :]

    def _take(self) -> None:
        assert self.process.stdout is not None
        while part := self.process.stdout.read(4096):
            self.shown += part.decode()


@contextlib.contextmanager
def checkout(report: Path, *words: str) -> Iterator[OperatorProcess]:
    it = OperatorProcess(["--report", str(report), *words])
    try:
        yield it
    finally:
        it.kill()


@pytest.fixture
def stack(tmp_path: Path) -> Iterator[RunningStack]:
    with running_stack(tmp_path) as it:
        yield it


def at(stack: RunningStack) -> list[str]:
    return ["--set", f"bus.connect={stack.endpoint}"]


def passes(it: OperatorProcess) -> bool:
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


def tries(it: OperatorProcess, title: str) -> Iterator[None]:
    """Begin a step and yield for each try; one of them must pass."""
    it.wait(f"] {title}\n", f"] {title}\r\n")
    it.wait("Press Enter to begin")
    it.type("")
    for _ in range(TRIES):
        yield
        if passes(it):
            return
        it.type("")
    raise AssertionError(it.shown)


def confirm(it: OperatorProcess) -> None:
    """Confirm a motion; on a busy host a repeated emergency stop may arrive after its reset."""
    if it.wait(f'Type "{PHRASE}"', 'Type "reset"') == 'Type "reset"':
        it.type("reset")
        it.wait(f'Type "{PHRASE}"')
    it.type(PHRASE)


def hold_a_hand(stack: RunningStack, it: OperatorProcess) -> None:
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
        return {each["todo"] for each in lines if each["level"] == "wrong"}

    wait_until(lambda: not wrong(), "a healthy robot", PATIENCE_S)
    report = tmp_path / "out" / "report.md"
    with checkout(report, *at(stack)) as it:
        it.begin()
        for _ in tries(it, "Link"):
            pass
        for _ in tries(it, "Sonars"):
            hold_a_hand(stack, it)
        for _ in tries(it, "Bumper"):
            it.wait("NOW press the bumper")
            stack.control.do(Bumper(pressed=True))
            it.wait("NOW release")
            assert BUMPER in wrong()
            stack.control.do(Bumper(pressed=False))
        for _ in tries(it, "Emergency stop"):
            pass
        for title in ("Forward", "Turn"):
            for _ in tries(it, title):
                confirm(it)
        assert it.sign() == 0, it.shown
    text = report.read_text(encoding="utf-8")
    assert "**Passed.**" in text
    assert text.count(" passed |") == 6
    assert "| counted / commanded |" in text
    assert "| wire.command_angular_unit | decidegree | default |" in text
    assert "T2 of bridge" in text
    assert text.rstrip().splitlines()[-1].startswith("Ada, ")
    wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")


def test_ctrl_c_stops_the_wheels_after_an_earlier_latch(
    stack: RunningStack, tmp_path: Path
) -> None:
    stack.control.do(Bumper(pressed=True))
    wait_until(lambda: '"cause": "contact"' in stack.log.read_text(), "safety's latch")
    stack.control.do(Bumper(pressed=False))
    report = tmp_path / "report.md"
    steps = [word for name in ("estop", "forward", "turn") for word in ("--only", name)]
    with checkout(report, *at(stack), *steps) as it:
        it.begin()
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
        it.signal(signal.SIGINT)
        assert it.end() == 1
        wait_until(lambda: abs(stack.speed()) < 0.001, "the vehicle stands")
        wait_until(lambda: stack.last() in ("stop", "brake"), "STOP at the board")
    text = report.read_text(encoding="utf-8")
    assert "Ended early: interrupted by the operator." in text
    assert "| Emergency stop | skipped | nobody \\| near the switch |" in text
    assert "Not signed." in text


def test_no_checkout_without_a_stack(tmp_path: Path) -> None:
    report = tmp_path / "report.md"
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    result = ran("checkout", "--set", f"bus.connect={endpoint}", "--report", str(report))
    assert result.returncode == EXIT_LINK
    assert f"no router answers at {endpoint}" in result.stderr
    assert not report.exists()
