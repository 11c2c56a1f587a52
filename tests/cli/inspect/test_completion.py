"""The scripts for shells; bash's is run."""

import shutil
import subprocess

import pytest

from cli.__main__ import COMMANDS, main
from verification.harness.waiting import PATIENCE_S


@pytest.fixture(scope="module")
def script() -> str:
    return written("bash")


def written(shell: str) -> str:
    """Return what ``t2 completion`` prints."""
    import contextlib
    import io

    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert main(["completion", shell]) == 0
    return out.getvalue()


def offered(script: str, *words: str) -> list[str]:
    """Return what bash would offer for the last of the words."""
    typed = " ".join(f"'{word}'" for word in ("t2", *words))
    asked = (
        f"COMP_WORDS=({typed}); COMP_CWORD={len(words)}; _t2; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    )
    done = subprocess.run(
        ["bash", "--norc", "-c", f"{script}\n{asked}"],
        capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.skipif(not shutil.which("bash"), reason="there is no bash here")
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("ech",), {"echo"}),
        (("",), set(COMMANDS)),
        (("echo", "tel/o"), {"tel/odom/odometry", "tel/odom/health"}),
        (("echo", "@cmd/m"), {"@cmd/motion"}),
        (("echo", "odometry", "--fi"), {"--field"}),
        (("call", "safety/r"), {"safety/reset", "safety/release"}),
        (("schema", "Odo"), {"Odometry"}),
        (("topic", "li"), {"list"}),
        (("topic", "echo", "tel/bridge/b"), {"tel/bridge/bumper"}),
        (("wire", "dec"), {"decode"}),
        (("echo", "--config", ""), set()),  # bash offers files
        (("completion", "f"), {"fish"}),
    ],
)
def test_bash(script: str, words: tuple[str, ...], expected: set[str]) -> None:
    assert set(offered(script, *words)) == expected


def test_zsh_takes_the_script_of_bash(script: str) -> None:
    shown = written("zsh")
    assert "bashcompinit" in shown
    assert shown.endswith(script)


def test_fish_has_a_line_for_each_command_and_option() -> None:
    lines = written("fish").splitlines()
    for name in COMMANDS:
        assert any(f"-a {name} " in line for line in lines), name
    assert any("from echo' -l field " in line for line in lines)
    assert any("topic ; and __fish_seen_subcommand_from hz' -l window " in line for line in lines)
