"""``t2``: help, unknown commands, and errors without the extras."""

import subprocess
import sys
from pathlib import Path

import pytest

from cli.__main__ import main
from tests.cli.processes import PATIENCE_S


@pytest.mark.parametrize(
    ("words", "code", "printed"),
    [
        ("", 0, "\nInspect:\n  doctor "),
        ("fly", 2, "unknown command 'fly'; \"t2 --help\" lists the commands"),
        ("eco safety/state", 2, "unknown command 'eco'; did you mean \"t2 echo\"?"),
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
