"""Shell completion: bash's script is run; zsh's and fish's queries are sent to ``t2``."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cli.__main__ import COMMANDS, main
from verification.harness.waiting import PATIENCE_S

PATH = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
EVERYWHERE = {"--help", "--version"}


def script(shell: str, capsys: pytest.CaptureFixture[str]) -> str:
    """Return the output of ``t2 completion``."""
    assert main(["completion", shell]) == 0
    return capsys.readouterr().out


def completed(line: str, **environment: str) -> str:
    """Run a program in bash with the variables of a completion; return its output."""
    program = environment.pop("program")
    done = subprocess.run(
        ["bash", "--norc", "-c", program],
        env={**os.environ, "PATH": PATH, "COMP_LINE": line, "COMP_POINT": str(len(line)),
             "COMP_TYPE": "9", **environment},
        capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def offered(shell_script: str, *words: str) -> set[str]:
    """Return the candidates of bash for the word at the cursor."""
    program = f"{shell_script}\n_python_argcomplete t2; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    return set(completed(" ".join(("t2", *words)), program=program).split())


@pytest.mark.skipif(not shutil.which("bash"), reason="bash is not installed")
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("ech",), {"echo"}),
        (("",), {*COMMANDS, *EVERYWHERE}),
        (("echo", "tel/o"), {"tel/odom/odometry", "tel/odom/health"}),
        (("echo", "odometry", "--fi"), {"--field"}),
        (("call", "safety/r"), {"safety/reset"}),
        (("wire", "dec"), {"decode"}),
        (("echo", "--config", "pyproject.t"), {"pyproject.toml"}),
        (("wire", "decode", "pyproject.t"), {"pyproject.toml"}),
        (("echo", "-o", "j"), {"json"}),
        (("completion", "f"), {"fish"}),
    ],
)
def test_bash(
    words: tuple[str, ...], expected: set[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert offered(script("bash", capsys), *words) == expected


@pytest.mark.parametrize(
    ("shell", "registration"),
    [("zsh", "compdef _python_argcomplete t2"), ("fish", "complete --command t2 -f -a")],
)
def test_script_of_a_shell_registers_the_command(
    shell: str, registration: str, capsys: pytest.CaptureFixture[str]
) -> None:
    shown = script(shell, capsys)
    assert registration in shown
    assert ("compinit" in shown) == (shell == "zsh")


@pytest.mark.parametrize(("shell", "separator"), [("fish", "\t"), ("zsh", ":")])
def test_candidates_have_descriptions(shell: str, separator: str) -> None:
    def lines(line: str) -> list[str]:
        return completed(
            line, program="t2 8>&1 9>/dev/null", _ARGCOMPLETE="1", _ARGCOMPLETE_SHELL=shell,
            _ARGCOMPLETE_IFS="\n", _ARGCOMPLETE_SUPPRESS_SPACE="1",
            **({"_ARGCOMPLETE_DFS": separator} if shell == "fish" else {}),
        ).splitlines()  # fmt: skip

    assert f"echo{separator}{COMMANDS['echo']}" in lines("t2 ec")
    assert any(line.startswith(f"--window{separator}of the last") for line in lines("t2 hz x --w"))
    assert f"tel/bridge/bumper{separator}the bumper strip" in lines("t2 echo tel/bridge/b")
