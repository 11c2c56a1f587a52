"""``t2``: help, exit codes, and errors without the extras."""

import re
import subprocess
import sys
from argparse import Namespace
from importlib.metadata import metadata
from pathlib import Path

import pytest

from cli.__main__ import COMMANDS, main
from common.cli_args import EXIT_CONFIG, EXIT_LINK
from common.errors import ConfigError
from t2.errors import LinkError, T2Error
from tests.cli.processes import PATIENCE_S


def test_help_names_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["--help"])
    assert end.value.code == 0
    shown = capsys.readouterr().out
    for name in COMMANDS:
        assert re.search(rf"^  {name}\s", shown, re.MULTILINE), name
    assert max(map(len, shown.splitlines())) <= 80


@pytest.mark.parametrize(
    ("words", "code", "printed"),
    [
        ("--version", 0, f"t2 {metadata('t2')['Version']}\n"),
        ("fly", 2, "unknown command 'fly'; \"t2 --help\" lists the commands"),
        ("eco safety/state", 2, "unknown command 'eco'; did you mean \"t2 echo\"?"),
        ("up --nonsense", 2, "t2 up: error: unrecognized arguments: --nonsense"),
        ("--set board.port=1 up", 2, "options follow the command, as in: t2 COMMAND --set"),
    ],
)
def test_command_lines(
    words: str, code: int, printed: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(words.split())
    assert end.value.code == code
    assert printed in "".join(capsys.readouterr())


@pytest.mark.parametrize(
    ("error", "code", "printed"),
    [
        (ConfigError("a setting is wrong"), EXIT_CONFIG, "t2 config: a setting is wrong\n"),
        (LinkError("a port is taken"), EXIT_LINK, "t2 config: a port is taken\n"),
        (T2Error("something is missing"), 1, "t2 config: something is missing\n"),
        (KeyboardInterrupt(), 130, ""),  # before the command handles it
    ],
)  # fmt: skip
def test_errors_with_commands_to_paste_and_exit_codes(
    error: BaseException,
    code: int,
    printed: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def run(_: Namespace) -> int:
        raise error

    monkeypatch.setattr("cli.settings.run", run)
    assert main(["config", "--config", "a b.toml", "--set", "x=1"]) == code
    assert capsys.readouterr().err == printed


# The robot's requirements have no extras: only commands that need one may fail, with a message.
ROBOT_SET = """
import sys
ABSENT = {"matplotlib", "textual", "pygame", "dpkt", "cryptography"}
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ABSENT:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Absent())
from cli.__main__ import COMMANDS, main
from services.teleop import __main__ as teleop
teleop.terminal_is_there = lambda: True
for name in COMMANDS:
    try:
        main([name, "--help"])
    except SystemExit as end:
        assert end.code == 0, name
capture = sys.argv[1]
for words in (["demo"], ["drive"], ["wire", "decode", capture], ["keys", "list"]):
    print(words[0], "gives", main(words), file=sys.stderr)
"""


def test_without_the_extras(tmp_path: Path) -> None:
    capture = tmp_path / "trip.pcap"
    capture.write_bytes(bytes.fromhex("d4c3b2a1") + bytes(20))
    result = subprocess.run(
        [sys.executable, "-c", ROBOT_SET, str(capture)],
        capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    lines = result.stderr.splitlines()
    demo, drive, wire, keys = lines[::2]
    assert demo.startswith("t2 demo: the demo needs matplotlib; ")
    assert demo.endswith("pip install -e '.[demo]' -e sdk")
    assert drive.startswith("t2 drive: the screen needs ")
    assert wire.endswith("pip install -e '.[inspect]'")
    assert keys.startswith("t2 keys: it needs cryptography: install the extra `keys`")
    assert lines[1::2] == [f"{name} gives 1" for name in ("demo", "drive", "wire", "keys")]
