"""Certificates as ``t2 keys`` makes them: of the robot, and of one who drives it."""

import io
import shutil
from contextlib import redirect_stdout
from pathlib import Path

from cli.__main__ import main

USER = 10001  # of the containers


class Keyring:
    """A site's authority in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.robot, self.driver = folder / "robot.001", folder / "driver.anna"
        at = ["--folder", str(folder)]
        for words in (
            ["init", "--site", "compose"],
            ["issue", "driver", "anna", "--robot", "001"],
            ["issue", "robot", "001", "--address", "127.0.0.1", "--address", "router"],
        ):
            with redirect_stdout(io.StringIO()):
                code = main(["keys", *words, *at])
            assert code == 0, words
        for file in (self.robot, *self.robot.iterdir()):
            shutil.chown(file, USER, USER)
        folder.chmod(0o711)
