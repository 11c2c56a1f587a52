"""Every command of docs/tour.md, run as it stands there, from the first terminal to the last."""

import contextlib
import os
import re
import signal
import socket
import subprocess
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from cli.demo import host_stalls
from tests.teleop.terminal import PATIENT, Terminal, at_terminal
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

ROOT = Path(__file__).parents[1]
TOUR = ROOT / "docs" / "tour.md"
# A block is run to its end, stays until a block is called after it has ended, or is typed into.
FENCE = re.compile(r"^```sh ?(?P<way>[^\n]*)\n(?P<commands>.*?)^```$", re.DOTALL | re.MULTILINE)
ACTIVATE = "source .venv/bin/activate\n"  # each terminal's first command
# What a newcomer would do to see whether what was started is there.
THERE = {
    "make up": "t2 doctor",
    "t2 record": "ls out/tour/*.mcap",
    "t2 dashboard": "curl --silent --fail --output /dev/null $DASHBOARD",
}
PATIENCE_S = 60.0
TRIES = 3  # the doctor reports scheduling stalls of a busy machine
KEY_S = 0.05  # between two repeats of a held key
PAUSE_S = 1.0  # a "-" among the keys

pytestmark = [pytest.mark.timed, pytest.mark.campaign, pytest.mark.timeout(300)]


class Newcomer:
    """A user with a checkout and one terminal for each command."""

    def __init__(self, folder: Path, env: Mapping[str, str]) -> None:
        self.folder = folder
        self.env = {**os.environ, **env}
        self.said = ""
        for each in ROOT.iterdir():
            if each.name not in ("out", ".git"):
                (folder / each.name).symlink_to(each)

    def run(self, commands: str) -> None:
        """Run commands to their end; each has to be well, on a bad machine at the third try."""
        for _ in range(TRIES):
            done = self._bash(commands)
            if done.returncode == 0:
                break
        self.said += done.stdout
        assert done.returncode == 0, f"{commands}\n{done.stdout}\n{done.stderr}\n{self.log()}"

    def drive(self, commands: str, typed: str) -> None:
        """Run a command in a terminal, and type into it once it shows that it is ready."""
        words = ["bash", "-ec", ACTIVATE + commands]
        with at_terminal(Terminal(words, self.folder, self.env)) as it:
            wait_until(lambda: it.shows(b"STOP"), "the screen", PATIENCE_S)
            for key in typed:
                time.sleep(PAUSE_S if key == "-" else KEY_S)
                it.type(key.strip("-"))
                it.read()
            wait_until(it.ends, "its end", PATIENCE_S)
            assert it.process.returncode == 0, it.shown[-2000:]

    @contextlib.contextmanager
    def keep(self, commands: str) -> Iterator[None]:
        """Leave commands running in a terminal of their own; ctrl-c ends them with the context."""
        there = next(look for word, look in THERE.items() if word in commands)
        with (self.folder / "terminals.log").open("ab") as output:
            process = subprocess.Popen(
                ["bash", "-ec", ACTIVATE + commands],
                cwd=self.folder, env=self.env, stdout=output, stderr=output,
                start_new_session=True,
            )  # fmt: skip
        try:
            wait_until(lambda: self._bash(there).returncode == 0, there, PATIENCE_S)
            yield
            os.killpg(process.pid, signal.SIGINT)
            process.wait(PATIENCE_S)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()

    def log(self) -> str:
        """Return the end of what the terminals that stay have shown."""
        return (self.folder / "terminals.log").read_text()[-3000:]

    def _bash(self, commands: str) -> "subprocess.CompletedProcess[str]":
        words = ["bash", "-ec", ACTIVATE + commands]
        return subprocess.run(
            words, cwd=self.folder, env=self.env, capture_output=True, text=True, check=False,
            timeout=PATIENCE_S,
        )  # fmt: skip


def elsewhere() -> dict[str, str]:
    """Return an environment whose stack meets no other one, with the limits that we can bear."""
    board, first, second = (free_port(socket.SOCK_DGRAM) for _ in range(3))
    page = free_port()
    settings = [
        f"board.port={board}",
        f"board.listen_ports=[{first}, {second}]",
        f"bus.listen=tcp/127.0.0.1:{free_port()}",
        f"dashboard.port={page}",
        *host_stalls.settings(host_stalls.measured()),
        *PATIENT[1::2],
    ]
    named = (one.split("=", 1) for one in settings)
    env = {f"T2__{path.upper().replace('.', '__')}": value for path, value in named}
    stamp = ROOT / ".venv/.installed"
    if stamp.exists():  # `make` must not rebuild the virtual environment that this test runs in
        stamp.touch()
    return {**env, "DASHBOARD": f"http://127.0.0.1:{page}/"}


def test_the_tour(tmp_path: Path) -> None:
    newcomer = Newcomer(tmp_path, elsewhere())
    with contextlib.ExitStack() as terminals:
        for block in FENCE.finditer(TOUR.read_text(encoding="utf-8")):
            way, commands = block["way"], block["commands"]
            if way == "stays":
                last = terminals.enter_context(contextlib.ExitStack())
                last.enter_context(newcomer.keep(commands))
            elif way.startswith("types="):
                newcomer.drive(commands, way.removeprefix("types="))
            else:
                if way == "ended":
                    last.close()
                newcomer.run(commands)
    assert "Emergency stop" in (tmp_path / "out/tour.html").read_text()
    assert "@cmd/drive/teleop" in newcomer.said
